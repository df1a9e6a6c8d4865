"""Plain English: a word list over strings, comments, names and Markdown; sentences and commit subjects."""

import ast
import io
import re
import subprocess
import tokenize
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROSE = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("app/**/*.md")])
FOLDERS = ("app", "bench", "engine", "training", "docs", "tests")
CODE = sorted([ROOT / "run.py", *(path for name in FOLDERS for path in ROOT.glob(f"{name}/**/*.py"))])
AVOIDED = {
    r"told|tells": "report, show, state",
    r"anew": "again",
    r"whoever": "a noun",
    r"errs?": "is off by, has an error of",
    r"but for": "except",
    r"go(es)? on": "continues",
    r"lets? go": "release",
    r"of before": "earlier, previous",
    r"what is (heard|seen|given)": "a noun",
    r"by which": "a noun, or a verb",
    r"what hands do": "gestures",
    # in the sense of compared with; a place is beside another
    r"beside (the|its|our|their) (truth|paper\S*|physics|figures?)|(our|results|model) beside": "compared with",
}
WORDS = re.compile("|".join(rf"\b({words})\b" for words in AVOIDED), re.IGNORECASE)
NAMES = {"told", "tells", "anew", "whoever", "errs", "obey", "believed", "tired"}  # parts of names, avoided too
# words with which a docstring begins as a clause, not as the noun of a thing or the verb of an action
CLAUSES = re.compile(
    r"(What|Whether|Of|How|Where|As|Which|Those|By|One|For|From|In|With|To|When|On|If|Whose|Who|That|Until)\b"
)
# third person, of functions
THIRD = re.compile(
    r"(Adds|Begins|Closes|Computes|Draws|Ends|Fills|Finds|Follows|Forgets|Gives|Keeps|Lets|Loads|Makes|Moves|Opens|Puts"
    r"|Raises|Reads|Renders|Returns|Says|Sends|Sets|Shows|Starts|Stops|Takes|Tells|Trains|Turns|Waits|Writes)\b"
)
LONGEST = 30  # words of a sentence
LONGEST_OF_DOCSTRINGS = 25
LONGEST_SUBJECT = 72
SINCE = "5d41648"  # the last commit before subjects were checked
SUBJECT = re.compile(r"[a-z][\w./, -]*: \S.*[^.]$")


@cache
def source(path: Path) -> str:
    return path.read_text("utf-8")


def tokens(path: Path) -> Iterator[tokenize.TokenInfo]:
    return tokenize.generate_tokens(io.StringIO(source(path)).readline)


def written(path: Path) -> Iterator[tuple[int, str]]:
    """The strings and comments of a Python file, with the line each starts in."""
    for token in tokens(path):
        if token.type in (tokenize.COMMENT, tokenize.STRING) or tokenize.tok_name[token.type] == "FSTRING_MIDDLE":
            text = re.sub(r"``?[^`\n]*``?", "`code`", token.string)  # names in docstrings
            if re.match(r"[rb]*f", text, re.IGNORECASE):
                text = re.sub(r"\{[^{}]*\}", "{}", text)  # names in f-strings
            if not re.fullmatch(r"\W*\w+\W*", text):  # one word names an argument or a field
                yield token.start[0], text


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """The lines of a Markdown file outside code."""
    fenced = False
    for number, line in enumerate(source(path).splitlines(), 1):
        fenced ^= line.lstrip().startswith("```")
        if not fenced and not line.startswith("    "):
            yield number, re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]*`", "`code`", line))


def test_no_word_of_the_list_is_used():
    found = []
    holding = (path for path in {*PROSE, *CODE} - {Path(__file__)} if WORDS.search(source(path)))
    for path in holding:  # a few files, whose tokens show where
        for first, text in prose(path) if path.suffix == ".md" else written(path):
            for number, line in enumerate(text.splitlines(), first):
                for hit in WORDS.finditer(line):
                    (remedy,) = (AVOIDED[words] for words in AVOIDED if re.fullmatch(words, hit[0], re.IGNORECASE))
                    found.append(f"{path.relative_to(ROOT)}:{number}: {hit[0]!r} (write: {remedy})")
    assert not found, "\n" + "\n".join(found)


def test_no_name_has_a_word_of_the_list():
    known = re.compile(rf"(?<![^\W_])({'|'.join(NAMES)})(?![^\W_])", re.IGNORECASE)
    found = {
        f"{path.relative_to(ROOT)}:{token.start[0]}: {token.string}"
        for path in set(CODE) - {Path(__file__)}
        if known.search(source(path))
        for token in tokens(path)
        if token.type == tokenize.NAME and NAMES & set(token.string.casefold().split("_"))
    }
    assert not found, "\n" + "\n".join(sorted(found))


def paragraphs(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Paragraphs and list items of numbered lines; no headings, no tables, no code."""
    number, words, table = 1, "", False
    for line_number, line in [*lines, (0, "")]:
        plain = line.strip()
        table = bool(plain) and (table or plain.startswith("|") or re.search(r"\S {3,}\S", plain) is not None)
        other = plain.startswith(("#", "!", "```", "<!--", ">>>")) or table
        if not plain or other or plain.startswith(("-", "*")) or re.match(r"\d+\. ", plain):
            yield number, words
            number, words = line_number, ""
        if not other:
            words += f" {plain}"


def long_sentences(lines: Iterable[tuple[int, str]], longest: int) -> list[tuple[int, str]]:
    split = re.compile(r"(?<=[.!?:;])[*_)]*\s+")
    found = [(number, each) for number, words in paragraphs(lines) for each in split.split(words.strip())]
    return [(number, each) for number, each in found if len(re.findall(r"\w[\w'’-]*", each)) > longest]


@pytest.mark.parametrize("path", PROSE, ids=lambda path: path.name)
def test_sentences_are_short(path):
    long = long_sentences(prose(path), LONGEST)
    assert not long, "\n" + "\n".join(f"{path.name}:{number}: {each}" for number, each in long)


PRODUCT = ["app", "engine", "training", "run.py"]


def docstrings(name: str) -> Iterator[tuple[str, ast.AST, bool, ast.Constant]]:
    """Docstrings of a folder's files: the file, the holder, whether it is the holder's own or a field's, the text."""
    for path in [path for path in CODE if path.is_relative_to(ROOT / name)]:
        for node in ast.walk(ast.parse(source(path))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                for place, each in enumerate(node.body):
                    text = each.value if isinstance(each, ast.Expr) else None
                    if isinstance(text, ast.Constant) and isinstance(text.value, str):
                        yield str(path.relative_to(ROOT)), node, place == 0, text


@pytest.mark.parametrize("name", PRODUCT)
def test_docstrings_begin_with_a_noun_or_a_verb_and_their_sentences_are_short(name):
    found = []
    for file, node, own, text in docstrings(name):
        function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        firsts = [each.match(text.value) for each in ([CLAUSES, THIRD] if function else [CLAUSES])]
        found += [f"{file}: {getattr(node, 'name', 'the module')}: {first[0]} …" for first in firsts if first and own]
        plain = re.sub(r"``?[^`]*``?", lambda code: "`code`" + "\n" * code[0].count("\n"), text.value)
        long = long_sentences(enumerate(plain.splitlines(), text.lineno), LONGEST_OF_DOCSTRINGS)
        found += [f"{file}:{number}: {each}" for number, each in long]
    assert not found, "\n" + "\n".join(found)


def test_commit_subjects_name_their_area_and_are_short():
    log = ["git", "log", "--no-merges", "--format=%s", f"{SINCE}..HEAD"]
    done = subprocess.run(log, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("the history of commits is not here")
    wrong = [text for text in done.stdout.splitlines() if len(text) > LONGEST_SUBJECT or not SUBJECT.match(text)]
    assert not wrong, f"\nwrite 'area: imperative', at most {LONGEST_SUBJECT} characters:\n" + "\n".join(wrong)
