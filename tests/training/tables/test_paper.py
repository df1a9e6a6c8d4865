import pytest

from training.tables.paper import METRICS, MODEL_ORDER, PRINTED, DatasetColumn, MeanFigure, factor, mark, paper_errors


def test_the_papers_figures_are_all_there():
    figures = paper_errors()
    assert len(figures) == 2 * 12 * 4  # strings, rows, data sets
    found = [entry.figure(metric) for entry in figures.values() for metric in METRICS]
    assert sum(figure is not None and figure.deviation is not None for figure in found) == 192
    for string in ("linear", "nonlinear"):
        for horizon, models in ((4000, MODEL_ORDER[:5]), (400, MODEL_ORDER[:7])):
            assert {key[2] for key in figures if key[:2] == (string, horizon)} == set(models)


@pytest.mark.parametrize(
    ("string", "horizon", "model", "column", "mse", "mae"),
    [
        ("nonlinear", 4000, "dmd", ("noise", 16000), (1.8313, 0.2467), (1.0953, 0.087)),
        ("nonlinear", 4000, "koopman_var", ("gaussian", 4000), (0.0113, 0.0061), (0.0977, 0.0284)),
        ("nonlinear", 400, "koopman_var", ("gaussian", 16000), (0.0003, 0.0), (0.0201, 0.0006)),
        ("nonlinear", 400, "frnn", ("noise", 4000), (0.7289, 0.0653), (0.8553, 0.0495)),
        ("linear", 4000, "koopman_var", ("noise", 16000), (0.0495, 0.0973), (0.1125, 0.1785)),
        ("linear", 4000, "dmd", ("gaussian", 4000), (0.0, 0.0), (0.006, 0.0007)),
        ("linear", 400, "fgru", ("gaussian", 16000), (0.0378, 0.0162), (0.214, 0.0551)),
        ("linear", 400, "frnn", ("noise", 16000), (0.4730, 0.3205), (0.6347, 0.2836)),
    ],
)
def test_figures_of_the_paper(string, horizon, model, column, mse, mae):
    entry = paper_errors()[string, horizon, model, DatasetColumn(*column)]
    assert (entry.rel_mse, entry.rel_mae) == (MeanFigure(*mse), MeanFigure(*mae))


@pytest.mark.parametrize(
    ("ours", "paper", "expected"),
    [
        ((0.08, None), (0.1, 0.02), "equal"),  # on the boundary, which floats miss
        ((0.12, None), (0.1, 0.02), "equal"),
        ((0.0799, None), (0.1, 0.02), "better"),
        ((0.1201, None), (0.1, 0.02), "worse"),
        ((0.05, 0.06), (0.1, 0.02), "equal"),  # ours is the larger deviation
        ((0.05, 0.03), (0.1, 0.04), "equal"),  # 3, 4, 5: both count, as variances of a difference do
        ((0.0499, 0.03), (0.1, 0.04), "better"),
        ((0.05, None, 0.03), (0.1, 0.04), "equal"),  # which strings are in the split counts as the seeds do
        ((0.04, 0.03, 0.04), (0.1, 0.02), "better"),
        ((0.04, 0.03, 0.04), (0.1, 0.034), "equal"),
        ((5e-6, 1e-7), (0.0, 0.0), "equal"),  # the paper's may be anything below its last decimal
        ((PRINTED, None), (0.0, 0.0), "equal"),
        ((6e-5, None), (0.0, 0.0), "worse"),
        ((5e-6, None), (0.0001, 0.0), "better"),
        ((float("inf"), None), (0.1, 0.02), "worse"),
    ],
)
def test_marks(ours, paper, expected):
    assert mark(MeanFigure(*ours), MeanFigure(*paper)) == expected


def test_a_figure_may_be_off_by_both_of_its_errors_and_its_ratio_is_one_of_printed_figures():
    assert MeanFigure(1.0).total is None
    assert MeanFigure(1.0, 0.3).total == MeanFigure(1.0, None, 0.3).total == 0.3
    assert MeanFigure(1.0, 0.3, 0.4).total == pytest.approx(0.5)
    assert factor(MeanFigure(5.65e-6), MeanFigure(0.0113)) == "×0.0005"
    assert factor(MeanFigure(1.0), MeanFigure(0.004)) == "×250"
    assert factor(MeanFigure(5e-6), MeanFigure(0.0)) == "> ×0.1"
