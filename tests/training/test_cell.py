"""Configurations: of a cell's name, of a file, and of earlier versions; each digest is for good."""

from dataclasses import dataclass, replace

import pytest

from engine.models import MODELS, build_model
from engine.models.configurations import LRUConfiguration
from engine.schema import SchemaError, write
from training.cell import Cell, configuration_of, load
from training.configuration import read_configuration
from training.results import RESULTS, read_results

DIGESTS = {
    Cell("koopman_var", True, "noise", 4000, 400, "paper"): "68b69a9cfa060660",
    Cell("koopman_integrated", False, "noise", 16000): "570c5b253699d762",
    # the paper's text, and its script: the table of differences is in docs/reproduce.md
    Cell("koopman", True, "noise", 4000, 400, "paper"): "27d19485a3d0f4f5",
    Cell("fgru", True, "noise", 4000, 400, "paper"): "bd67c985ff38a240",
    Cell("koopman", True, "noise", 4000, 400, "published"): "b09499adb7a74972",
    Cell("koopman_var", True, "noise", 4000, 400, "published"): "11bd5426458b30f8",
    Cell("lru", True, "noise", 4000, 400, "published"): "bc3c027e66aba681",
    Cell("s5", True, "noise", 4000, 400, "published"): "e73be9288f224315",
}


def test_digests_are_for_good():
    """Rows are known by them: where this fails, a default has changed; leave it."""
    assert {cell: configuration_of(cell).digest for cell in DIGESTS} == DIGESTS


def test_a_digest_covers_what_a_run_has_by_default_and_its_seed_but_no_title(monkeypatch):
    cell = Cell("lru", True, "noise", 4000)
    found = configuration_of(cell)
    digest = found.digest
    assert replace(found, model_configuration={"state_size": 128}).digest == digest
    assert configuration_of(cell, {"count": 1000}).digest == replace(found, title="other").digest == digest

    @dataclass(frozen=True)
    class Larger(LRUConfiguration):
        state_size: int = 256

    monkeypatch.setitem(MODELS, "lru", ("lru.LRU", Larger))
    assert found.digest != digest


# Earlier versions


def test_a_configuration_of_an_earlier_version_is_the_same_run_as_today():
    now = configuration_of(Cell("lru", True, "gaussian", 4000, 400))
    plain = write(now)
    plain["recipe"] |= {"random_start": False, "koopman_terms": "text"}
    assert read_configuration(plain, "a preset") == now
    plain["recipe"]["random_start"] = True
    with pytest.raises(SchemaError, match=r"recipe\.random_start: True is of an earlier version; train it again"):
        read_configuration(plain, "a preset")


@pytest.mark.parametrize(
    ("name", "flags"),
    [
        ("koopman_var", {"initialisation": "physics"}),
        ("koopman", {"initialisation": "paper", "latent_epochs": 1000}),
        ("koopman_blind", {"blind": True, "latent_epochs": 1000}),
        ("koopman_integrated_blind", {"blind": True, "latents_per_mode": 1}),
        ("frnn_400", {"blind": True}),
        ("lru_paper", {"blind": False, "initialisation": ""}),
    ],
)
def test_the_flags_of_before_starts_had_one_name_are_read(name, flags):
    now = load(f"nylon_nonlinear_noise_4k_{name}")
    plain = write(now)
    del plain["recipe"]["start"]
    plain["recipe"] |= flags
    found = read_configuration(plain, "a preset")
    assert (found.start, found.digest) == (now.start, now.digest)


def test_sizes_that_are_no_longer_there_count_in_the_digest_and_are_read_with_the_value_that_they_had():
    now = configuration_of(Cell("koopman_integrated", True, "gaussian", 16_000))
    assert now.digest in {row.digest for row in read_results(RESULTS)}
    gone = {"multiplier_widths": [], "decoder_widths": [], "rate_unit": 1e-3, "gain_limit_db": 6.0}
    plain = write(now)
    plain["model_configuration"] |= gone
    assert read_configuration(plain, "a preset").digest == now.digest
    assert build_model(now.model, gone).configuration == build_model(now.model).configuration
    plain["model_configuration"]["gain_limit_db"] = 3.0
    with pytest.raises(SchemaError, match=r"model_configuration\.gain_limit_db: 3\.0 is of an earlier version"):
        read_configuration(plain, "a preset")


# Refusals


CONFIGURATION = """
title = "a run"
model = "koopman_var"
[data]
initial = "gaussian"
rate_hz = 4000
modes = 10
[recipe]
epochs = 1
"""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (CONFIGURATION + "[model_configuration]\nstate_size = 1_000_000_000\n", "state_size must lie in"),
        (CONFIGURATION + "[model_configuration]\ngrid_points = 51\n", "grid_points is 51, the data's are 101"),
        (CONFIGURATION + 'start = "guess"\n', "start 'guess' is not one of"),
        (CONFIGURATION.replace("modes = 10", "modes = 10\ncount = 100_000_000"), "GiB of data"),
        (CONFIGURATION.replace("modes = 10", "modes = 10\nsubsteps = 10_000_000"), "substeps must lie in"),
        (CONFIGURATION.replace("modes = 10", "modes = 100"), "cannot hold 100 modes"),
        ("title = " + "[" * 30_000 + "]" * 30_000, "recursion"),
        ("title = '\udcff'", "not valid TOML"),
        (CONFIGURATION.replace("4000", "4" * 5000), "digits"),
    ],
)
def test_a_file_that_would_take_for_ever_is_refused_by_file_and_field(text, words, tmp_path):
    path = tmp_path / "run.toml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(SchemaError, match=words) as caught:
        load(str(path))
    reported = str(caught.value)
    assert str(path) in reported and len(reported) <= 500 and reported.isprintable()
