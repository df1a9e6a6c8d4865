"""Building plug-ins: names, files that are kept, faults of the disk, and what a killed build leaves."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest

from app.export.plugin import build, texts
from app.export.plugin.build import build_plugin
from app.export.plugin.formats import FORMATS, TARGETS, PluginError, this_target
from app.export.plugin.identity import held_in
from app.export.plugin.image import Image, image_of
from app.export.plugin.objects import ObjectError, digest, objects_of
from engine.kernels import cache as kernel_cache
from engine.python_process import python_command, python_environment
from engine.whole_file import WriteError
from tests.app.export.plugin import lv2_host
from tests.app.export.plugin.host import Browser, Library
from tests.app.export.plugin.pieces import LEARNED, instrument_of, preset_of

pytestmark = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]")

LARGEST_BYTES = 2_000_000  # the code has 0.8 MB more


def test_process_calls_nothing_but_arithmetic(objects: Path) -> None:
    if shutil.which("nm") is None:
        pytest.skip("needs nm")
    paths = objects_of("linux-x64", objects)
    listed = subprocess.run(["nm", "-u", *paths], capture_output=True, text=True, check=True).stdout.split()
    assert not {"malloc", "free", "calloc", "fopen", "pthread_mutex_lock"} & set(listed)


def lv2_listed(folder: Path) -> list[str] | None:
    """Identifiers that lilv finds in a folder; none where its program is not here."""
    if not shutil.which("lv2ls"):
        return None
    environment = {**os.environ, "LV2_PATH": str(folder)}
    done = subprocess.run(["lv2ls"], env=environment, capture_output=True, text=True, check=True)
    return sorted(done.stdout.splitlines())


def test_names_in_any_script_are_plug_ins_of_their_own_and_their_bundle_is_valid(
    objects: Path, tmp_path: Path
) -> None:
    names = ("é" * 60, "古琴" * 18, "古琴" * 18 + "!", "🎸" * 60, "My bass!", "my bass-", "My bass", "عود", "!!!")
    harp, preset = instrument_of("concert_harp"), preset_of("concert_harp")
    made = [image_of(harp.model_copy(update={"name": name}), preset) for name in names]
    library = Library(build_plugin(made, "clap", this_target(), tmp_path / "bank", objects))
    assert list(library.plugins) == [image.id for image in made]
    assert all(library.create(id).save() for id in library.plugins)
    library.destroy_instances()
    bundle = build_plugin(made, "lv2", this_target(), tmp_path / "bank", objects)
    for image in made:
        lv2_host.Instance(bundle, image.id, image.parameters, 48_000).destroy()
    assert lv2_listed(tmp_path) in (None, sorted(f"urn:{image.id}" for image in made))
    described = (bundle / "instruments.ttl").read_text(encoding="utf-8")
    assert re.search(r"lv2:minorVersion [1-9]\d* ; lv2:microVersion \d+ ;", described)
    assert "lv2:extensionData state:interface ;" in described
    if shutil.which("lv2_validate") and shutil.which("sord_validate"):  # which the first calls
        files = [each.name for each in bundle.glob("*.ttl")]  # it skips paths that have a space
        done = subprocess.run(["lv2_validate", *files], cwd=bundle, capture_output=True, text=True, check=False)
        assert "Found 0 errors" in done.stdout + done.stderr, done  # its status is 0 for some errors
        assert not any(name in done.stderr for name in files)


def test_instruments_are_small_and_one_that_cannot_sound_is_refused() -> None:
    for name in ("concert_toms", "frame_drum", "slow_water"):  # the most drums or modes, the longest room
        assert image_of(instrument_of(name), preset_of(name)).bytes < LARGEST_BYTES
    sitar = instrument_of("sitar")
    assert sitar.pickup.kind == "bridge"  # whose force a recording does not give
    with pytest.raises(ValueError, match="no key sounds"):
        image_of(sitar, preset_of(LEARNED))


def test_any_other_kernel_makes_other_object_files_and_an_unknown_target_is_refused(
    objects: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the user chooses the folder of compiled code, it is the same for every version."""
    with pytest.raises(ValueError, match="linux-x64, linux-arm64, windows-x64"):
        objects_of("amiga", objects)
    assert set(TARGETS) == {"linux-x64", "linux-arm64", "windows-x64", "macos-x64", "macos-arm64"}
    read, usual = set[Path](), Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.add(path) or usual(path))
    digest()
    assert set(Path(kernel_cache.__file__).parent.rglob("*.py")) <= read


def contents(path: Path) -> dict[Path, bytes]:
    return {each: each.read_bytes() for each in (path, *path.rglob("*")) if each.is_file()}


@pytest.mark.parametrize("form", FORMATS)
def test_a_plug_in_that_holds_others_is_kept_until_it_is_to_be_replaced(
    images: list[Image], objects: Path, tmp_path: Path, form: str
) -> None:
    place, target = tmp_path / "bank", this_target()
    path = build_plugin(images[:2], form, target, place, objects)
    assert held_in(path) == {image.id for image in images[:2]}
    before = contents(path)
    with pytest.raises(PluginError, match=r"another instrument, .*--replace"):
        build_plugin(images[1:3], form, target, place, objects)
    with pytest.raises(PluginError, match=f"two instruments are named {images[0].name}"):
        build_plugin([*images[:2], images[0]], form, target, place, objects)
    assert contents(path) == before
    build_plugin(images[:1], form, target, place, objects, replace=True)
    assert held_in(path) == {images[0].id}
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    if form == "clap":
        library = Library(path)
        browser = Browser(library)
        assert browser.ids == [f"{images[0].id}.presets"]
        assert [(preset.name, preset.key) for preset in browser.read()[1]] == [(images[0].name, images[0].id)]
        assert library.create(images[0].id).load_preset(images[0].id)
        library.destroy_instances()


def test_faults_of_disk_and_compiler_are_named_and_leave_nothing(
    images: list[Image], objects: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for said in ("error: NoSpaceLeft", "LLVM ERROR: IO failure on output stream: No space left on device"):
        monkeypatch.setattr(build, "run_waiting", lambda *_, said=said: (1, said))
        with pytest.raises(WriteError, match=r"No space left on device.*free some space"):
            build_plugin(images[:1], "clap", this_target(), tmp_path / "bank", objects)
        assert not list(tmp_path.iterdir())
    monkeypatch.undo()
    with monkeypatch.context() as lacking, pytest.raises(PluginError, match=r"linking for \S+ failed: .*error:"):
        lacking.setattr(build, "objects_of", lambda *_: (tmp_path / "none.o",))
        build_plugin(images[:1], "clap", this_target(), tmp_path / "bank", objects)
    with monkeypatch.context() as unknown, pytest.raises(ObjectError, match="compiled: KeyError: 'no part'"):
        unknown.setattr(texts, "PARTS", ("no part",))
        objects_of(this_target(), tmp_path)
    assert [path for path in tmp_path.iterdir() if path.suffix != ".lock"] == []
    monkeypatch.setattr(build, "objects_of", lambda *_: pytest.fail("it was compiled"))
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", Path("/dev/null/there"), Path("/proc/there")):
        with pytest.raises(WriteError, match=f"^{folder}.*: cannot be written .*; "):
            build_plugin(images[:1], "clap", this_target(), folder / "bank", objects)


KILLED = """
import os, signal, sys
from pathlib import Path
from app.export.plugin import build, texts
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image
build.objects_of = lambda *_: ()
build.run_waiting = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
image = Image("org.learned-strings.a", "A", b"", (), ())
build.build_plugin([image], "lv2", this_target(), Path(sys.argv[1]), Path())
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a kill that nothing can catch")
def test_what_a_killed_build_left_goes_with_the_next(
    images: list[Image], objects: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    aside, out = tmp_path / "temporary", tmp_path / "out"
    aside.mkdir()
    command = python_command("-c", KILLED, str(out / "a"))
    subprocess.run(command, env={**python_environment(), "TMPDIR": str(aside)}, check=False)
    (left,) = aside.iterdir()
    assert (left / "images.c").exists()
    monkeypatch.setattr("tempfile.tempdir", str(aside))
    build_plugin(images[:1], "lv2", this_target(), out / "b", objects)
    assert not list(aside.iterdir())
    assert [each.name for each in out.iterdir()] == ["b.lv2"]
