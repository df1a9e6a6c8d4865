"""Building plug-ins: identifiers, files that are kept, faults of the disk, and what a killed build leaves."""

import re
import shutil
import subprocess
import unicodedata
from pathlib import Path

import pytest

from app.export.plugin import build, texts
from app.export.plugin.build import build_plugin
from app.export.plugin.formats import FORMATS, TARGETS, PluginError, this_target
from app.export.plugin.identity import MOST_BYTES, check_kept, held_in, identifier, lost_with
from app.export.plugin.image import image_of
from app.export.plugin.objects import ObjectError, digest, objects_of
from app.instruments.library import SHIPPED, list_instruments
from engine.kernels import cache as kernel_cache
from engine.whole_file import WriteError
from tests.app.export.plugin import lv2_host
from tests.app.export.plugin.host import Library, presets
from tests.app.export.plugin.pieces import LEARNED, instrument_of, preset_of

LARGEST_BYTES = 2_000_000  # the code has 0.8 MB more
HERE = this_target()


def test_names_in_any_script_are_plug_ins_of_their_own_and_their_bundle_is_valid(objects, tmp_path):
    names = ("é" * 60, "古琴" * 18, "古琴" * 18 + "!", "🎸" * 60, "My bass!", "my bass-", "My bass", "عود", "!!!")
    harp, preset = instrument_of("concert_harp"), preset_of("concert_harp")
    made = [image_of(harp.model_copy(update={"name": name}), preset) for name in names]
    library = Library(build_plugin(made, "clap", HERE, tmp_path / "bank", objects))
    assert list(library.plugins) == [image.id for image in made]
    assert all(library.create(id).save() for id in library.plugins)
    library.destroy_instances()
    bundle = build_plugin(made, "lv2", HERE, tmp_path / "bank", objects)
    for image in made:
        instance = lv2_host.Instance(bundle, image.id, image.parameters, 48_000)
        instance.activate()
        instance.destroy()
    described = (bundle / "instruments.ttl").read_text(encoding="utf-8")
    assert re.search(r"lv2:minorVersion [1-9]\d* ; lv2:microVersion \d+ ;", described)
    assert "lv2:extensionData state:interface ;" in described
    if shutil.which("lv2_validate") and shutil.which("sord_validate"):  # which the first calls
        files = [each.name for each in bundle.glob("*.ttl")]  # it skips paths that have a space
        done = subprocess.run(["lv2_validate", *files], cwd=bundle, capture_output=True, text=True, check=False)
        assert "Found 0 errors" in done.stdout + done.stderr, done  # its status is 0 for some errors
        assert not any(name in done.stderr for name in files)


def test_instruments_are_small_and_one_that_cannot_sound_is_refused():
    for name in ("concert_toms", "frame_drum", "slow_water"):  # the most drums or modes, the longest room
        assert image_of(instrument_of(name), preset_of(name)).bytes < LARGEST_BYTES
    assert instrument_of("sitar").pickup.kind == "bridge"  # whose force a recording does not give
    with pytest.raises(ValueError, match="no key sounds"):
        image_of(instrument_of("sitar"), preset_of(LEARNED))


def test_any_other_kernel_makes_other_object_files_and_an_unknown_target_is_refused(tmp_path, monkeypatch):
    """Where the user chooses the folder of compiled code, it is the same for every version."""
    with pytest.raises(ValueError, match="linux-x64, linux-arm64, windows-x64"):
        objects_of("amiga", tmp_path)
    assert set(TARGETS) == {"linux-x64", "linux-arm64", "windows-x64", "macos-x64", "macos-arm64"}
    read, usual = set[Path](), Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.add(path) or usual(path))
    digest()
    assert set(Path(kernel_cache.__file__).parent.rglob("*.py")) <= read


def contents(path: Path) -> dict[Path, bytes]:
    return {each: each.read_bytes() for each in (path, *path.rglob("*")) if each.is_file()}


@pytest.mark.parametrize("form", FORMATS)
def test_a_plug_in_that_holds_others_is_kept_until_it_is_to_be_replaced(images, objects, tmp_path, form, monkeypatch):
    place, (one, two, three, *_) = tmp_path / "bank", images.values()
    path = build_plugin([one, two], form, HERE, place, objects)
    assert held_in(path) == {one.id, two.id}
    before = contents(path)
    with pytest.raises(PluginError, match=r"another instrument, .*--replace"):
        build_plugin([two, three], form, HERE, place, objects)
    with pytest.raises(PluginError, match=f"two instruments are named {one.name}"):
        build_plugin([one, two, one], form, HERE, place, objects)
    with monkeypatch.context() as small, pytest.raises(PluginError, match=r"at most 2 instruments, not 3"):
        small.setattr("app.export.plugin.build.MOST_IMAGES", 2)
        build_plugin([one, two, three], form, HERE, place, objects)
    assert contents(path) == before
    build_plugin([one], form, HERE, place, objects, replace=True)
    assert held_in(path) == {one.id}
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    if form == "clap":
        library = Library(path)
        assert presets(library) == [(one.name, one.id)]
        assert library.create(one.id).load_preset(one.id)
        library.destroy_instances()


def test_faults_of_disk_and_compiler_are_named_and_leave_nothing(images, objects, tmp_path, monkeypatch):
    def refused(error: type[Exception], words: str, folder: Path = tmp_path) -> None:
        with pytest.raises(error, match=words):
            build_plugin([*images.values()][:1], "clap", HERE, folder / "bank", objects)
        assert not list(tmp_path.iterdir())

    for said in ("error: NoSpaceLeft", "LLVM ERROR: IO failure on output stream: No space left on device"):
        with monkeypatch.context() as full:
            full.setattr(build, "run_waiting", lambda *_, said=said: (1, said))
            refused(WriteError, r"No space left on device.*free some space")
    with monkeypatch.context() as lacking:
        lacking.setattr(build, "objects_of", lambda *_: (tmp_path / "none.o",))
        refused(PluginError, r"linking for \S+ failed: .*error:")
    monkeypatch.setattr(build, "objects_of", lambda *_: pytest.fail("it was compiled"))
    for folder in (Path(__file__), Path("/dev/null/there"), Path("/proc/there")):
        refused(WriteError, f"^{folder}.*: cannot be written .*; ", folder)
    monkeypatch.setattr(texts, "PARTS", ("no part",))
    with pytest.raises(ObjectError, match="compiled: KeyError: 'no part'"):
        objects_of(HERE, tmp_path)
    assert [path for path in tmp_path.iterdir() if path.suffix != ".lock"] == []


def test_what_a_killed_build_left_goes_with_the_next(images, objects, tmp_path, monkeypatch):
    def die(*_: object) -> None:
        raise KeyboardInterrupt

    aside, out, one = tmp_path / "temporary", tmp_path / "out", [*images.values()][:1]
    aside.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(aside))
    with monkeypatch.context() as killed, pytest.raises(KeyboardInterrupt):
        killed.setattr("engine.whole_file.os.getpid", lambda: 999_999_999)
        killed.setattr("engine.whole_file.shutil.rmtree", lambda *_, **__: None)
        killed.setattr(build, "run_waiting", die)
        build_plugin(one, "lv2", HERE, out / "a", objects)
    (left,) = aside.iterdir()
    assert (left / "images.c").exists()
    build_plugin(one, "lv2", HERE, out / "b", objects)
    assert not list(aside.iterdir())
    assert [each.name for each in out.iterdir()] == ["b.lv2"]


# Identifiers: one for each name, the same in every build, and short enough for every host

PREFIX = "org.learned-strings."
FACTORY = [entry.instrument.name for entry in list_instruments(SHIPPED)[0]]
# Names that fold to one another; those of the factory differ from the last two.
FOLDING = "My bass!|my bass-|My bass|my bass|MY BASS|My-bass|My  bass|My bass -|Bäss|ﬁddle|Fiddle"
MORE = "Straße|STRASSE|İstanbul|istanbul|Ⅷ|²|2|!!!|???|---|| |عود|عود!|\u202eعود|Twelve string guitar|Ukulele  low G"
LONG = ("古琴" * 18, "古琴" * 18 + "!", "é" * 60, "é" * 59 + "è", "🎸" * 300, "🎸" * 299, "a" * 300, "A" + "a" * 299)
NAMES = (*FOLDING.split("|"), *MORE.split("|"), *LONG, unicodedata.normalize("NFD", "Bäss"))


def test_names_that_fold_alike_differ_and_plain_ones_keep_theirs():
    names = {*NAMES, *FACTORY, *(each.swapcase() for each in FACTORY), *(f"{each} " for each in NAMES)}
    ids = {identifier(name) for name in names}
    assert len(ids) == len(names)
    fits = re.compile(r"[^\x00-\x20<>\"{}|^`\\]+")  # in an IRI of LV2 in Turtle
    assert all(len(id.encode()) <= MOST_BYTES and fits.fullmatch(id) for id in ids)
    for name in FACTORY:
        assert identifier(name) == PREFIX + "".join(c if c.isalnum() else "-" for c in name.lower())
    for name, wanted in (("My bass", "my-bass"), ("Bäss 2", "bäss-2"), ("古琴", "古琴")):
        assert identifier(name) == PREFIX + wanted
    assert identifier("My bass!") == f"{PREFIX}my-bass--b3dcc31a205f"  # songs find it by this


def test_what_a_plug_in_holds_is_read_from_it_and_what_is_none_is_never_replaced(tmp_path):
    ids = {identifier(name) for name in NAMES}
    file, manifest = tmp_path / "bank.clap", tmp_path / "bank.lv2" / "manifest.ttl"
    noise = bytes(range(256)) * 50
    file.write_bytes(noise.join([b"", *(id.encode().ljust(128, b"\0") for id in sorted(ids)), b""]))
    manifest.parent.mkdir()
    manifest.write_text("\n".join(f"<urn:{id}> a lv2:Plugin ." for id in sorted(ids)), "utf-8")
    for path, inside in ((file, file), (manifest.parent, manifest)):
        assert held_in(path) == ids
        check_kept(path, ids)
        with pytest.raises(PluginError, match=r"holds 2 other instruments, as .*--replace"):
            check_kept(path, sorted(ids)[2:])
        inside.write_text("<urn:org.others> a lv2:Plugin .", encoding="utf-8")
        with pytest.raises(PluginError, match="no plug-in of this program"):
            lost_with(path, ids)
    assert lost_with(tmp_path / "none", ids) == frozenset()
