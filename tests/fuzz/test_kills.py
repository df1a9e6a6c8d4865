"""Any order of kill and rerun ends with the same files: works are killed at random moments, and begun again."""

import multiprocessing
import os
import random
import shutil
import signal
import sys
import time
from collections.abc import Iterator

import pytest

from tests.fuzz import works
from tests.fuzz.conftest import LONG

KILLS = {  # 200 in all with `run.py test --fuzz`
    "render": (2, 60),
    "dataset": (2, 50),
    "train": (1, 45),
    "save_many_settings": (2, 45),
}

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs POSIX processes")


@pytest.fixture(scope="module")
def context() -> Iterator[multiprocessing.context.BaseContext]:
    """Processes whose parent has loaded all that they need, and holds nothing of this one."""
    with pytest.MonkeyPatch.context() as instrumented:
        instrumented.setenv("PYTHONPATH", os.pathsep.join(sys.path))
        found = multiprocessing.get_context("forkserver")
        found.set_forkserver_preload(["tests.fuzz.works"])
        yield found


@pytest.mark.parametrize("name", KILLS)
def test_a_killed_work_ends_as_if_it_had_not_been(name, context, tmp_path, seed):
    folder, kills = tmp_path / "work", KILLS[name][LONG]

    def begun(afresh: bool = False) -> multiprocessing.Process:
        if afresh:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
        process = context.Process(target=getattr(works, name), args=(folder,))
        process.start()
        return process

    begun(afresh=True).join()  # the first loads what is loaded late
    started = time.monotonic()
    process = begun(afresh=True)
    process.join()
    assert process.exitcode == 0
    lasted_s, undisturbed = time.monotonic() - started, works.contents(folder)
    assert undisturbed
    draw, found, tries = random.Random(f"{seed}:{name}"), 0, 0
    while found < kills:
        tries += 1
        assert tries <= 5 * kills, f"{name} ends before it can be killed"
        for rerun in range(draw.choice((1, 1, 2))):  # the rerun may be killed too
            started, process = time.monotonic(), begun(afresh=not rerun)
            process.join(lasted_s * draw.random())
            process.kill()
            process.join()
            if process.exitcode == -signal.SIGKILL:
                found += 1
            elif not rerun:  # the computer was busier before: the next is killed sooner
                lasted_s = min(lasted_s, time.monotonic() - started)
        process = begun()
        process.join()
        where = f"{name} after {found} kills, seed {seed}"
        assert process.exitcode == 0, where
        left = works.contents(folder)
        assert left.keys() == undisturbed.keys(), where
        unlike = [file for file in left if left[file] != undisturbed[file]]
        assert not unlike, f"{where}: {unlike}"
    print(f"\n{name}: {found} kills survived of {found} (an undisturbed run takes {lasted_s:.2g} s, seed {seed})")
