"""Configurations of earlier versions keep their meaning."""

import pytest

from engine.models import build_model
from engine.schema import SchemaError, write
from training.cell import Cell, configuration_of
from training.configuration import read_configuration
from training.results import RESULTS, read_results

CELL = Cell("lru", True, "gaussian", 4000, 400)


def test_a_configuration_of_an_earlier_version_is_the_same_run_as_today():
    now = configuration_of(CELL)
    plain = write(now)
    plain["recipe"] |= {"random_start": False, "koopman_terms": "text"}
    assert read_configuration(plain, "a preset") == now
    plain["recipe"]["random_start"] = True
    with pytest.raises(SchemaError, match=r"recipe\.random_start: True is of an earlier version; train it again"):
        read_configuration(plain, "a preset")


@pytest.mark.parametrize(
    ("cell", "flags"),
    [
        (Cell("koopman_var", True, "noise", 4000), {"initialisation": "physics"}),
        (Cell("koopman", True, "noise", 4000), {"initialisation": "paper", "latent_epochs": 1000}),
        (Cell("koopman", True, "noise", 4000, recipe="blind"), {"blind": True, "latent_epochs": 1000}),
        (Cell("koopman_integrated", True, "noise", 4000, recipe="blind"), {"blind": True, "latents_per_mode": 1}),
        (Cell("koopman_integrated", True, "noise", 4000, recipe="hinted"), {"blind": True, "latents_per_mode": 0}),
        (Cell("frnn", True, "noise", 4000, 400), {"blind": True}),
        (Cell("lru", True, "noise", 4000, recipe="paper"), {"blind": False, "initialisation": ""}),
    ],
)
def test_the_flags_of_before_starts_had_one_name_are_read(cell, flags):
    now = configuration_of(cell)
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
