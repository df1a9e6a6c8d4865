"""The files of a plug-in: sources, linked by a C compiler that pip installs, in the place where hosts look."""

from __future__ import annotations

import errno
import hashlib
import os
import plistlib
import re
import shutil
import tempfile
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

import numpy as np

from app.export.plugin.formats import TARGETS, PluginError, check_compiler
from app.export.plugin.identity import PREFIX, check_kept, lost_with
from app.export.plugin.image import MAKER, Image
from app.export.plugin.layout import MOST_IMAGES, layout_header
from app.export.plugin.objects import STUBS, objects_of, reason_of, run_waiting
from app.shared.version import program_version
from engine.effects.room import room_noise
from engine.kernels.prepared import NOISE_UNIT
from engine.python_process import python_command, python_environment
from engine.whole_file import WriteError, explain, naming, whole_file, whole_folder, working_folder

FULL_BYTES = 2**24  # where less is left, a build that failed has filled the disk
COMPILING = 0.97  # of the time of a first build, measured
COMMON = ("instrument.c", "effects.c", "thread.c", "kernels.c")
LIBRARY_ENDINGS = {"linux": ".so", "windows": ".dll", "macos": ".dylib"}
VST3_ENDINGS = {"linux": ".so", "windows": ".vst3"}
VST3_FOLDERS = {"linux-x64": "x86_64-linux", "linux-arm64": "aarch64-linux", "windows-x64": "x86_64-win"}


def build_plugin(
    images: Sequence[Image],
    form: str,
    target: str,
    path: Path,
    cache: Path,
    advanced: Callable[[str, float], None] = lambda step, share: None,
    *,
    replace: bool = False,
) -> Path:
    """Build a plug-in that holds these instruments: the file, or the folder of the bundle.

    One that is there is replaced as a whole.

    Args:
        form: one of `formats.FORMATS`.
        path: see `plugin_path`.
        cache: a folder that keeps object files for the next build.
        advanced: is called a few times a second with the name of the step and the done share of the whole, 0 … 1.
            May raise, to end it.
        replace: a plug-in that is there and holds other instruments, too.

    Raises:
        PluginError: the compiler is not installed, linking failed, two instruments have one name, or what is there
            would be lost.
        ObjectError: the kernels cannot be compiled for the target.
        WriteError: a file cannot be written.
    """
    check_compiler()
    names = [image.name for image in images]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise PluginError(f"two instruments are named {twice}: hosts know them by their names; rename one")
    if len(images) > MOST_IMAGES:
        raise PluginError(f"a bank has at most {MOST_IMAGES} instruments, not {len(images)}; build several")
    path = plugin_path(path, form)
    (lost_with if replace else check_kept)(path, {image.id for image in images})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with working_folder(path.parent, path.name):  # it can be written: found before work that takes a minute
            pass
        kernels = objects_of(target, cache, lambda share: advanced("compiling the kernels", COMPILING * share))
        with working_folder(Path(tempfile.gettempdir()), "learned-strings-plugin") as folder:
            library = _linked(folder, images, form, target, kernels, lambda: advanced("linking", COMPILING))
            _place_library(library, images, form, target, path)
    except OSError as error:
        raise WriteError(explain(Path(os.fsdecode(error.filename or path)), error)) from error
    return path


def plugin_path(path: Path, form: str) -> Path:
    """The path with the ending of the format."""
    return path if path.suffix == f".{form}" else path.with_name(f"{path.name}.{form}")


def _place_library(library: Path, images: Sequence[Image], form: str, target: str, path: Path) -> None:
    """Put the linked library where hosts look for it within what is built."""
    system = target.partition("-")[0]
    inside: dict[str, Path | str] = {}
    if form == "lv2":
        binary = f"{path.stem}{LIBRARY_ENDINGS[system]}"
        inside = {binary: library, **_lv2_descriptions(images, binary)}
    elif system == "macos":
        plist = {
            "CFBundleExecutable": path.stem,
            "CFBundleIdentifier": f"{PREFIX}{hashlib.sha256(os.fsencode(path.stem)).hexdigest()[:16]}",  # plain ASCII
            "CFBundleName": path.stem,
            "CFBundlePackageType": "BNDL",
            "CFBundleVersion": "1",
        }
        inside = {
            f"Contents/MacOS/{path.stem}": library,
            "Contents/Info.plist": plistlib.dumps(plist).decode(),
            "Contents/PkgInfo": "BNDL????",
        }
    elif form == "vst3":
        inside = {f"Contents/{VST3_FOLDERS[target]}/{path.stem}{VST3_ENDINGS[system]}": library}
    if not inside:
        with whole_file(path) as part:
            shutil.copyfile(library, part)
        return
    with whole_folder(path) as bundle:
        for name, content in inside.items():
            place = bundle / name
            place.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(content, Path):
                shutil.copyfile(content, place)
            else:
                place.write_text(content, encoding="utf-8")


def _images(images: Sequence[Image], folder: Path) -> str:
    """A C source that holds the images' bytes."""
    lines = ["#include <stdint.h>", '#include "instrument.h"']
    for number, image in enumerate(images):
        (folder / f"image{number}.bin").write_bytes(image.content)
        lines.append(f"_Alignas(64) static const unsigned char image{number}[] = {{")
        lines += [f'#embed "image{number}.bin"', "};"]
    noise = np.rint(room_noise() / NOISE_UNIT).astype(np.int32)  # finer than single precision
    (folder / "noise.bin").write_bytes(noise.tobytes())
    lines += [
        f"static const union {{ unsigned char bytes[{noise.nbytes}]; int32_t samples[{noise.size}]; }} noise_bytes ="
    ]
    lines += ["{{", '#embed "noise.bin"', "}};", "const int32_t *const noise = noise_bytes.samples;"]
    entries = ", ".join(f"(const image *)image{number}" for number in range(len(images)))
    lines += [f"const image *const images[] = {{{entries}}};", f"const int32_t image_count = {len(images)};"]
    return "\n".join(lines) + "\n"


def _stubs() -> str:
    """Stubs of names that error paths of compiled code refer to, and no plug-in has: they return nothing."""
    lines = ["void *PyExc_RuntimeError = 0;"]
    lines += [f"void *{name}(void) {{ return 0; }}" for name in sorted(STUBS - {"PyExc_RuntimeError"})]
    return "\n".join(lines) + "\n"


def _linked(
    folder: Path,
    images: Sequence[Image],
    form: str,
    target: str,
    kernels: Sequence[Path],
    waiting: Callable[[], None],
) -> Path:
    """The path of the library, linked in a working folder. Raises PluginError, or OSError where the disk is full.

    Args:
        kernels: object files, see `objects_of`.
        waiting: is called a few times a second while the linker runs; may raise, to end it.
    """
    waiting()
    with naming(folder.parent):
        for source in files("app.export.plugin").joinpath("shell").iterdir():
            (folder / source.name).write_bytes(source.read_bytes())
        (folder / "layout.h").write_text(layout_header(program_version()), encoding="utf-8")
        (folder / "stubs.c").write_text(_stubs(), encoding="utf-8")
        (folder / "images.c").write_text(_images(images, folder), encoding="utf-8")
    library = folder / "library"
    command = python_command("-m", "ziglang", "cc", "-target", TARGETS[target].linker, "-shared", "-O2", "-std=c23")
    command += ["-fvisibility=hidden", "-fno-sanitize=all", "-s", "-fPIC", "-o", str(library)]
    command += [str(folder / name) for name in (*COMMON, f"{form}.c", "images.c", "stubs.c")]
    command += [*map(str, kernels), "-lm", *(["-lpthread"] if target.startswith("linux") else [])]
    code, output = run_waiting([command], python_environment(), lambda _: waiting())
    full = code and shutil.disk_usage(folder).free < FULL_BYTES  # then even words of the compiler may be lost
    if full or "NoSpaceLeft" in output or os.strerror(errno.ENOSPC) in output:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder.parent))
    if code:
        remedy = "; set ZIG_GLOBAL_CACHE_DIR to a folder that can be written" if "cache dir" in output else ""
        raise PluginError(f"linking for {target} failed: {reason_of(code, output)}{remedy}")
    return library


def _lv2_descriptions(images: Sequence[Image], binary: str) -> dict[str, str]:
    """The descriptions of an LV2 bundle, by file name."""
    prefixes = "".join(f"@prefix {name}: <{uri}> .\n" for name, uri in _PREFIXES.items())
    manifest, instruments = [prefixes], [prefixes]
    minor, micro = _lv2_version(program_version())
    for image in images:
        head = f"<urn:{image.id}> a lv2:Plugin, lv2:InstrumentPlugin, doap:Project ;"
        manifest.append(f"{head}\n  lv2:binary <{quote(binary)}> ;\n  rdfs:seeAlso <instruments.ttl> .\n")
        ports = [
            "a lv2:InputPort, atom:AtomPort ; atom:bufferType atom:Sequence ; atom:supports midi:MidiEvent ;\n"
            '    lv2:designation lv2:control ; lv2:index 0 ; lv2:symbol "events" ; lv2:name "Events"',
            'a lv2:OutputPort, lv2:AudioPort ; lv2:index 1 ; lv2:symbol "left" ; lv2:name "Left"',
            'a lv2:OutputPort, lv2:AudioPort ; lv2:index 2 ; lv2:symbol "right" ; lv2:name "Right"',
            'a lv2:OutputPort, lv2:ControlPort ; lv2:index 3 ; lv2:symbol "latency" ; lv2:name "Latency" ;\n'
            "    lv2:designation lv2:latency ; lv2:portProperty lv2:reportsLatency, lv2:integer ;\n"
            "    lv2:minimum 0.0 ; lv2:maximum 192000.0",
        ]
        for number, control in enumerate(image.parameters):
            symbol = "".join(c if c.isalnum() else "_" for c in control.id)
            stepped = " lv2:portProperty lv2:integer, lv2:enumeration ;" if control.steps else ""
            points = "".join(
                f' lv2:scalePoint [ rdfs:label "{word}" ; rdf:value {value} ] ;'
                for value, word in enumerate(control.steps, round(control.low))
            )
            ports.append(
                f'a lv2:InputPort, lv2:ControlPort ; lv2:index {4 + number} ; lv2:symbol "{symbol}" ;\n'
                f'    lv2:name "{_escape_quotes(control.name)}" ;{stepped}{points}\n'
                f"    lv2:minimum {control.low:.9f} ; lv2:maximum {control.high:.9f} ; "
                f"lv2:default {control.standard:.9f}"
            )
        instruments.append(
            f'{head}\n  doap:name "{_escape_quotes(image.name)}" ;\n  doap:maintainer [ foaf:name "{MAKER}" ] ;\n'
            "  doap:license <https://opensource.org/license/mit> ;\n"
            f"  lv2:minorVersion {minor} ; lv2:microVersion {micro} ;\n"
            "  lv2:requiredFeature urid:map ;\n  lv2:optionalFeature lv2:hardRTCapable ;\n"
            "  lv2:extensionData state:interface ;\n  lv2:port "
            + " ,\n  ".join(f"[\n    {port} ;\n  ]" for port in ports)
            + " .\n"
        )
    return {"manifest.ttl": "\n".join(manifest), "instruments.ttl": "\n".join(instruments)}


def _lv2_version(version: str) -> tuple[int, int]:
    """The minor and the micro version, which rise with the program's: even for a release, odd for all before it."""
    match = re.match(r"(\d{1,4})\.(\d{1,3})(?:\.(\d{1,4}))?(.*)", version)
    if match is None:
        return 1, 1
    major, minor, instrument, rest = match.groups()
    return 2 * (1000 * int(major) + int(minor)), 2 * int(instrument or 0) + bool(rest)


def _escape_quotes(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')


_PREFIXES = {
    "lv2": "http://lv2plug.in/ns/lv2core#",
    "atom": "http://lv2plug.in/ns/ext/atom#",
    "midi": "http://lv2plug.in/ns/ext/midi#",
    "urid": "http://lv2plug.in/ns/ext/urid#",
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "rdfs": "http://www.w3.org/2000/01/rdf-schema#",
    "doap": "http://usefulinc.com/ns/doap#",
    "state": "http://lv2plug.in/ns/ext/state#",
    "foaf": "http://xmlns.com/foaf/0.1/",
}
