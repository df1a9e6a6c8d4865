#!/usr/bin/env python3
"""Prepare and start Learned Strings on Linux, macOS or Windows, with nothing but Python 3.11 to 3.14.

python3 run.py                 open the app
python3 run.py FILE ...        open it with these: presets, instruments, MIDI files, whatever can be dropped on it
python3 run.py test [args]     ruff, mypy and lint-imports, then pytest (with args, if given)
python3 run.py test --quick    the tests nearest to changed files, in a minute and a half
python3 run.py test --fuzz     the attack on whatever reads a file, at length: thousands of damaged ones; and kills
python3 run.py bundle          make dist/learned-strings, a folder that starts without Python, and a file of it
python3 run.py docs            build the documents as a site in site/; warnings are errors
python3 run.py bench NAME      measure speed, sound and memory on this machine (without NAME: which there are)
python3 run.py setup           only prepare
python3 run.py -- render ...   the command line: everything after -- goes to learned-strings

The first start makes .venv beside this file, with the versions of constraints.txt, compiles what makes the
sound, and takes minutes; later ones start at once. Delete .venv to begin afresh.
"""

import collections
import contextlib
import csv
import ctypes
import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tarfile
import threading
import time
from pathlib import Path

# Before any annotation, and in words that Python 3.6 can read, so that an old Python gets as far as this.
if not (3, 11) <= sys.version_info < (3, 15):
    sys.exit(f"run.py: needs Python 3.11 to 3.14; this is {sys.version.split()[0]}: {sys.executable}")

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
LOCK = VENV / "run.lock"
STAMP = VENV / "run.json"
COMPILED = VENV / "compiled"
WINDOWS = os.name == "nt"
SCRIPTS = VENV / ("Scripts" if WINDOWS else "bin")
SUFFIX = ".exe" if WINDOWS else ""
PYTHON = SCRIPTS / f"python{SUFFIX}"
APP = SCRIPTS / f"learned-strings{SUFFIX}"
DIST = ROOT / "dist"
BUNDLE = DIST / ("learned-strings.app" if sys.platform == "darwin" else "learned-strings")
BUNDLED = BUNDLE / ("Contents/MacOS" if sys.platform == "darwin" else "") / APP.name

LINTS = {
    "ruff check": [PYTHON, "-m", "ruff", "check", "."],
    "ruff format": [PYTHON, "-m", "ruff", "format", "--check", "."],
    "mypy": [PYTHON, "-m", "mypy"],
    "lint-imports": [SCRIPTS / f"lint-imports{SUFFIX}"],
}

# What pip cannot bring on Linux: the name of Debian's package, and the sign that it is there (a library
# that loads, a module, a file, or a program). A package renamed to ...t64 still answers to its old name.
APP_PACKAGES = {
    "libportaudio2": "libportaudio.so.2",
    "libdbus-1-3": "libdbus-1.so.3",
    "libegl1": "libEGL.so.1",
    "libfontconfig1": "libfontconfig.so.1",
    "libgl1": "libGL.so.1",
    "libglib2.0-0": "libgthread-2.0.so.0",
    "libx11-xcb1": "libX11-xcb.so.1",
    "libxcb-cursor0": "libxcb-cursor.so.0",
    "libxcb-icccm4": "libxcb-icccm.so.4",
    "libxcb-keysyms1": "libxcb-keysyms.so.1",
    "libxcb-randr0": "libxcb-randr.so.0",
    "libxcb-shape0": "libxcb-shape.so.0",
    "libxcb-sync1": "libxcb-sync.so.1",
    "libxcb-xfixes0": "libxcb-xfixes.so.0",
    "libxkbcommon-x11-0": "libxkbcommon-x11.so.0",
    "fonts-dejavu-core": "/usr/share/fonts/**/*.[ot]t[fc]",
    f"python3.{sys.version_info[1]}-venv": "import ensurepip",
}
# For the tests of the real sound path, of MIDI, of a real window and of SoundFonts, which are skipped without them.
TEST_PACKAGES = {
    "fluidsynth": "fluidsynth",
    "pulseaudio": "pulseaudio",
    "pulseaudio-utils": "parec",
    "libasound2-plugins": "/usr/lib/*/alsa-lib/libasound_module_pcm_pulse.so",
    "xvfb": "Xvfb",
    "jackd2": "jackd",
}
OTHER_INSTALLERS = {
    "dnf": "sudo dnf install portaudio mesa-libEGL mesa-libGL libxkbcommon-x11 dejavu-sans-fonts"
    " xcb-util-cursor xcb-util-wm xcb-util-keysyms xcb-util-image xcb-util-renderutil",
    "pacman": "sudo pacman -S --needed portaudio libglvnd libxkbcommon-x11 ttf-dejavu"
    " xcb-util-cursor xcb-util-wm xcb-util-keysyms xcb-util-image xcb-util-renderutil",
}
# A sign of an NVIDIA card; PyTorch's own builds without CUDA; how long their server may take to answer.
NVIDIA = Path("/proc/driver/nvidia")
CPU_BUILDS = "https://download.pytorch.org/whl/cpu"
ANSWER_S = 3.0
TICK_S = 20.0  # between two signs of life of a step
# Whether system packages can be installed here without asking anyone: Debian or its kin, as root.
APT = sys.platform == "linux" and shutil.which("apt-get") is not None and os.geteuid() == 0


class SetupError(Exception):
    """A step of the set-up failed; the message says which, and the remedy."""


def main(words: list[str]) -> int:
    """Prepare for what the words ask, do it, and return its exit status."""
    action, arguments = parse(words)
    try:
        prepare(action, window=action == "start" and words[:1] != ["--"])
        if action == "test":
            return check(arguments)
        if action == "docs":
            return documents()
        if action == "bundle":
            return bundle()
        if action == "bench":
            return subprocess.call([PYTHON, "-m", "bench", *arguments], cwd=ROOT)
        return start(arguments) if action == "start" else 0
    except KeyboardInterrupt:
        return fail("stopped", 130)
    except (OSError, SetupError) as error:
        return fail(f"cannot prepare {VENV}: {error}")


def parse(words: list[str]) -> tuple[str, list[str]]:
    """Return the action and its arguments; help, absent files and words without a meaning end the program."""
    if not words:
        return "start", []
    if words[0] == "--":
        return "start", words[1:]
    if words[0] in ("test", "bench"):
        return words[0], words[1:]
    if words in (["setup"], ["docs"], ["bundle"]):
        return words[0], []
    usage = (__doc__ or "").strip()
    if words[0] in ("-h", "--help"):
        print(usage)
        sys.exit(0)
    if all(map(is_file_name, words)):
        absent = [word for word in words if not Path(word).is_file()]
        if absent:
            sys.exit(fail(f"no such file: {', '.join(absent)}; check the name", 2))
        return "start", words
    print(f"{usage}\n\nrun.py: not understood: {' '.join(words)}", file=sys.stderr)
    sys.exit(2)


def is_file_name(word: str) -> bool:
    """Return True if a word has a folder or an ending, as nothing else that is understood here."""
    return not word.startswith("-") and bool(Path(word).suffix or {os.sep, os.altsep or os.sep} & set(word))


def start(arguments: list[str]) -> int:
    """Become learned-strings, so that its output, signals and exit status are its own."""
    if not WINDOWS:
        os.execv(APP, [str(APP), *arguments])
    return subprocess.call([APP, *arguments])


def check(arguments: list[str]) -> int:
    """Run every lint, showing what the failed ones say, then pytest last; return non-zero if any failed."""
    env = {"QT_QPA_PLATFORM": "offscreen", **os.environ}
    if arguments[:1] == ["--quick"]:
        return subprocess.call([PYTHON, "-m", "tests.quick", *arguments[1:]], cwd=ROOT, env=env)
    if arguments[:1] == ["--fuzz"]:
        env |= {"LEARNED_STRINGS_FUZZ": "long", "OMP_NUM_THREADS": "1"}
        return subprocess.call(
            [PYTHON, "-m", "pytest", "-s", "tests/fuzz", "tests/app/export/plugin", *arguments[1:]], cwd=ROOT, env=env
        )
    failed = []
    for name, command in LINTS.items():
        done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        print(f"{name}: {'FAILED' if done.returncode else 'passed'}", flush=True)
        if done.returncode:
            failed.append(name)
            os.write(1, done.stdout)
    if not arguments:
        # A worker more than cores, for tests wait too; one numerical thread in each, or they fight over the cores.
        arguments = ["-n", str(min((os.cpu_count() or 1) + 1, 4)), "--dist", "worksteal"]
        env = {"OMP_NUM_THREADS": "1", **env}
    status = subprocess.call([PYTHON, "-m", "pytest", *arguments], cwd=ROOT, env=env)
    return fail("failed before the tests: " + ", ".join(failed), status or 1) if failed else status


def documents() -> int:
    """Build the site with MkDocs, which is installed when it is first needed."""
    with locked():
        if not all((site_packages() / name).is_dir() for name in ("mkdocs", "material", "mkdocstrings")):
            pip("--no-build-isolation", "-e", ".[docs]")
    env = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    return subprocess.call([PYTHON, "-m", "mkdocs", "build", "--strict"], cwd=ROOT, env=env)


def bundle() -> int:
    """Make a folder that starts without Python, with compiled kernels, and one compressed file of it."""
    with locked():
        if not (site_packages() / "PyInstaller").is_dir():
            pip("--no-build-isolation", "-e", ".[bundle]")
    trouble = "no bundle was made, for the reason above; remedy: put that right, free 3 GB of disk, then try again"
    say("collecting the bundle: a few minutes")
    places = ["--distpath", DIST, "--workpath", ROOT / "build"]
    run_step([PYTHON, "-m", "PyInstaller", "--noconfirm", *places, "learned-strings.spec"], trouble)
    say("compiling its sound engine: one to five minutes")
    run_step([BUNDLED, "-P", "-m", "engine.warm"], trouble)
    say("compressing it: a few minutes")
    with ticking():
        packed = compress()
    say(f"ready: {packed}, {packed.stat().st_size / 1e6:.0f} MB; to start it: {BUNDLED}")
    return 0


def compress() -> Path:
    """Write the bundle as one file: a zip for Windows, else a tar, which keeps links and permissions."""
    if WINDOWS:
        return Path(shutil.make_archive(str(BUNDLE), "zip", DIST, BUNDLE.name))
    packed = DIST / "learned-strings.tar.xz"
    with tarfile.open(packed, "w:xz", preset=1) as archive:
        archive.add(BUNDLE, BUNDLE.name)
    return packed


def prepare(action: str, window: bool) -> None:
    """Make the system's packages and .venv fit for the action; a start with nothing to do is silent."""
    stamp = read_stamp()
    if stamp and action == "start":
        if window:
            say_absent(missing(stamp["absent"]))
    else:
        with locked():
            absent = system_packages(action)
            say_absent(absent)
            if not read_stamp():  # a set-up that this one waited for may have made it
                environment(absent)
    if not compiled():
        with locked():
            compile_kernels()
    if action == "setup":
        say("ready; to open the app: python3 run.py")


def compiled() -> bool:
    """Return True if what makes the sound has been compiled as it is now, for this .venv."""
    try:
        return COMPILED.read_text("utf-8") == kernels()
    except OSError:
        return False


def compile_kernels() -> None:
    """Compile what makes the sound; the window would else have its user wait for it."""
    if compiled():  # by a set-up that this one waited for
        return
    say("compiling the sound engine, once for each version of it: one to five minutes")
    trouble = "the sound engine was not compiled, for the reason above; remedy: delete .venv, then try again"
    run_step([PYTHON, "-m", "engine.warm"], trouble)
    COMPILED.write_text(kernels(), "utf-8")
    say("the sound engine is ready")


def kernel_sources() -> list[Path]:
    """List the files whose functions are compiled, and those whose numbers are in their code."""
    numbers = (ROOT / f"engine/{name}.py" for name in ("bounds", "levels", "parameters"))
    return sorted([*ROOT.glob("engine/kernels/**/*.py"), *ROOT.glob("engine/*/_*kernel.py"), *numbers])


def kernels() -> str:
    """Hash the compiled functions' sources, and what else .venv holds."""
    sources = filter(Path.is_file, kernel_sources())
    return hashlib.sha256(b"\0".join([fingerprint().encode(), *(path.read_bytes() for path in sources)])).hexdigest()


def read_stamp() -> dict | None:
    """Return what the last set-up wrote, or None where .venv is not, or no longer, as that left it."""
    try:
        stamp = json.loads(STAMP.read_text("utf-8"))
        packages = {path.name for path in site_packages().iterdir()}
        whole = APP.exists() and Path(settings()["home"]).exists() and packages.issuperset(stamp["packages"])
        return stamp if whole and stamp["fingerprint"] == fingerprint() else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def fingerprint() -> str:
    """Hash all that decides what .venv should hold: what is asked for, where it lies, and its Python."""
    files = [ROOT / "pyproject.toml", ROOT / "constraints.txt", VENV / "pyvenv.cfg"]
    places = f"{VENV}\n{PYTHON.resolve(strict=True)}\n".encode()
    return hashlib.sha256(places + b"\0".join(path.read_bytes() for path in files)).hexdigest()


def settings() -> dict[str, str]:
    """Return pyvenv.cfg: the version and place of the Python that made .venv, and the command it ran."""
    lines = (VENV / "pyvenv.cfg").read_text("utf-8").splitlines()
    return {key.strip(): value.strip() for key, _, value in (line.partition("=") for line in lines)}


def site_packages() -> Path:
    """Return the folder that pip installs into."""
    version = ".".join(settings()["version"].split(".")[:2])
    return VENV / "Lib" / "site-packages" if WINDOWS else VENV / "lib" / f"python{version}" / "site-packages"


@contextlib.contextmanager
def locked():
    """Let one set-up run at a time: a second waits, until the first and the pip it started have ended."""
    if VENV.is_symlink() or not VENV.is_dir():
        remove(VENV)  # a file, or a link, whose folder is another's
        VENV.mkdir()
    with LOCK.open("a") as handle:
        if WINDOWS:
            import msvcrt

            while True:
                with contextlib.suppress(OSError):  # after ten seconds of waiting
                    msvcrt.locking(handle.fileno(), msvcrt.LK_LOCK, 1)
                    break
        else:
            import fcntl

            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                say("waiting for another set-up to end")
                fcntl.flock(handle, fcntl.LOCK_EX)
        os.set_inheritable(handle.fileno(), True)  # pip holds the lock too, should this process be killed
        yield


def environment(absent: list[str]) -> None:
    """Make or mend .venv. Its stamp goes first and comes back last: a set-up cut short leaves none."""
    STAMP.unlink(missing_ok=True)
    if sound():
        mend()
    else:
        make_venv()
    pip("setuptools")
    pip("torch", *torch_source())
    pip("--no-build-isolation", "-e", ".[dev]")
    try:
        pip("--no-build-isolation", "-e", ".[midi]")
    except SetupError:
        say("warning: MIDI input was not installed, for the reason above; going on without")
    stamp = {
        "fingerprint": fingerprint(),
        "absent": {name: sign for name, sign in APP_PACKAGES.items() if name in absent},
        "packages": sorted({path.name for path in site_packages().iterdir()} - {"__pycache__"}),
    }
    draft = STAMP.with_suffix(".tmp")
    draft.write_text(json.dumps(stamp, indent=1), "utf-8")
    draft.replace(STAMP)


def sound() -> bool:
    """Return True if .venv was made in this place, by a Python that still runs, as does its pip."""
    try:
        made = settings()
        numbers = made["version"].split(".")[:2]
        if not made["command"].endswith(str(VENV)) or not (3, 11) <= tuple(map(int, numbers)) < (3, 15):
            return False
        command = [PYTHON, "-I", "-m", "pip", "--version"]
        reply = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
        return f"(python {'.'.join(numbers)})" in reply and all(map(whole, site_packages().glob("pip-*")))
    except (OSError, ValueError, KeyError):
        return False


def mend() -> None:
    """Remove what a pip cut short left, and the record of each package not whole: pip then brings it again."""
    for package in [*site_packages().glob("~*"), *site_packages().glob("*.dist-info")]:
        if not whole(package):
            say(f"mending {package.stem}")
            remove(package)


def whole(package: Path) -> bool:
    """Return True if every file in a package's RECORD is there in its full size; compiled ones come and go."""
    try:
        with (package / "RECORD").open(newline="", encoding="utf-8") as rows:
            sizes = {package.parent / name: int(size) for name, _, size in csv.reader(rows) if size}
        return all(path.stat().st_size == size for path, size in sizes.items() if path.suffix != ".pyc")
    except (OSError, ValueError):
        return False


def remove(path: Path) -> None:
    """Remove a file, a link, or a folder with all that is in it."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def make_venv() -> None:
    """Make .venv from nothing, except the lock in it."""
    say(f"making {VENV}; this takes minutes the first time")
    for path in set(VENV.iterdir()) - {LOCK}:
        remove(path)
    trouble = "no virtual environment, for the reason above; remedy: put that right, then try again"
    run_step([sys.executable, "-I", "-m", "venv", VENV], trouble)


def pip(*arguments: str) -> None:
    """Install into .venv, in the versions of constraints.txt and no others."""
    trouble = (
        "pip failed, for the reason above: often the network, a full disk, or a Python too new for these"
        " versions; remedy: put that right, then try again"
    )
    command = [PYTHON, "-I", "-X", "utf8", "-m", "pip", "install", "--no-input", "-c", "constraints.txt"]
    run_step([*command, *arguments], trouble, env={**os.environ, "PIP_USER": "0"}, close_fds=False)


def torch_source() -> list[str]:
    """Return where else pip is to look for torch: on Linux without an NVIDIA card, among the builds without CUDA."""
    if sys.platform != "linux" or NVIDIA.exists() or shutil.which("nvidia-smi"):
        return []
    if reachable(CPU_BUILDS + "/torch/"):
        say("no NVIDIA card: taking PyTorch's build without CUDA")
        return ["--extra-index-url", CPU_BUILDS]
    say("no NVIDIA card, and PyTorch's build without CUDA is out of reach: going on with the large one, up to 3 GB")
    return []


def reachable(address: str) -> bool:
    """Return True if a server has the page. One that is silent for ANSWER_S has not, nor has a slow name server."""
    import urllib.request  # tens of milliseconds, which only a set-up spends

    answers = []

    def ask():
        # whatever is raised, as by a proxy that is set up wrongly, is no answer
        with contextlib.suppress(Exception), urllib.request.urlopen(address, timeout=ANSWER_S):
            answers.append(True)

    asking = threading.Thread(target=ask, daemon=True)
    asking.start()
    asking.join(ANSWER_S)
    return bool(answers)


def run_step(command: list, trouble: str, **options) -> None:
    """Run a command and show on standard error how far it is; if it fails, its last lines and `trouble`."""
    shown = ("Collecting", "Installing", "Setting up")
    tail = collections.deque(maxlen=15)
    options |= {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with ticking(), subprocess.Popen(command, cwd=ROOT, encoding="utf-8", errors="replace", **options) as process:
        for line in process.stdout:
            tail.append(line.rstrip())
            if line.strip().startswith(shown):
                say("  " + line.strip().split(" (from")[0][:100])
    if process.returncode:
        print(*tail, sep="\n", file=sys.stderr)
        raise SetupError(trouble)


@contextlib.contextmanager
def ticking():
    """Say now and then how long the step has taken, so that a quiet one does not look dead."""
    begun, over = time.monotonic(), threading.Event()

    def tick() -> None:
        while not over.wait(TICK_S):
            say(f"  ... {time.monotonic() - begun:.0f} s")

    thread = threading.Thread(target=tick, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def system_packages(action: str) -> list[str]:
    """Install what this system lacks where that can be done unasked; return what the app still lacks."""
    if APT:
        # Each table by itself, since one may fail: PulseAudio may not fit beside PipeWire.
        for table in [APP_PACKAGES, TEST_PACKAGES] if action == "test" else [APP_PACKAGES]:
            try:
                if missing(table):
                    apt_install(missing(table))
            except SetupError as error:
                say(f"warning: {error}; going on without")
    return missing(APP_PACKAGES)


def missing(table: dict[str, str]) -> list[str]:
    """Return the packages of a table that this machine lacks; macOS and Windows need none of them."""
    return [name for name, sign in table.items() if sys.platform == "linux" and not present(sign)]


def present(sign: str) -> bool:
    """Return True if a library loads, a module or file exists, or a program is on the path. No process is started."""
    if sign.startswith("import "):
        return importlib.util.find_spec(sign.removeprefix("import ")) is not None
    if sign.startswith("/"):
        return any(Path("/").glob(sign[1:]))
    if ".so." not in sign:
        return shutil.which(sign) is not None
    try:
        return bool(ctypes.CDLL(sign))
    except OSError:
        return False


def apt_install(packages: list[str]) -> None:
    """Install Debian packages, waiting for another apt-get; one that would remove packages is refused."""
    say("installing with apt-get: " + " ".join(packages))
    env = {**os.environ, "DEBIAN_FRONTEND": "noninteractive", "LC_ALL": "C.UTF-8"}
    with contextlib.suppress(SetupError):  # old lists may do; if not, the next step says so
        run_step(["apt-get", "update"], "apt-get update failed", env=env)
    options = ["-y", "--no-install-recommends", "--no-remove", "-o", "DPkg::Lock::Timeout=300"]
    run_step(["apt-get", "install", *options, *packages], "apt-get install failed", env=env)


def say_absent(packages: list[str]) -> None:
    """Say the one line to type that installs system packages, as far as this system's way is known."""
    if not packages:
        return
    lines = [line for tool, line in OTHER_INSTALLERS.items() if shutil.which(tool)]
    if shutil.which("apt-get"):
        sudo = "" if APT else "sudo "
        lines = [f"{sudo}apt-get install --no-install-recommends {' '.join(packages)}"]
    where = lines[0] if lines else f"what Debian calls {' '.join(packages)}"
    say(f"this system lacks packages that pip cannot bring; to install them:\n  {where}")


def say(message: str) -> None:
    """Tell the person at the terminal; standard output belongs to the program that is started."""
    print(message, file=sys.stderr, flush=True)


def fail(message: str, status: int = 1) -> int:
    """Say what went wrong, and return the exit status that says so too."""
    say(f"run.py: {message}")
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
