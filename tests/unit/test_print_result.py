"""Tables on a terminal: what does not fit stands below, and no figure is cut."""

import re
from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from pellucid.models.estimates import Parameter, Verdict
from pellucid.study.procedures.print_result import SCREEN_LAYOUT, print_result
from pellucid.study.procedures.result import CombinedResult, FigureTable, ParameterTable, Result

CELLS = ("0.474±0.031*", "−1.25e−05", "<0.001", "16.2 to 27.5")


def printed(width, *tables):
    result = Result(study="s", headline="", tables=tables, verdicts=(), rows=(), cards={}, checksums={})
    text = StringIO()
    print_result(Console(width=width, highlight=False, no_color=True, file=text), result)
    return text.getvalue()


def wide(conditions):
    heads = ("Index", "", *(f"Condition {i} (rad/s)" for i in range(conditions)))
    rows = tuple((f"Peak velocity {i}", "upwards", *(CELLS[(i + j) % 4] for j in range(conditions))) for i in range(3))
    return FigureTable("Means", heads, rows)


@pytest.mark.parametrize("width", [40, 60, 80, 100])
@pytest.mark.parametrize("conditions", [1, 4, 9])
def test_every_figure_is_whole_whatever_the_width(width, conditions):
    text = printed(width, wide(conditions))
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    flat = " ".join(text.split())
    for i in range(3):
        for cell in {CELLS[(i + j) % 4] for j in range(conditions)}:
            shown = sum(CELLS[(k + j) % 4] == cell for k in range(3) for j in range(conditions))
            assert flat.count(cell) == shown
    assert flat.count("Condition") == conditions


def test_what_stands_below_has_its_rows_names_again():
    text = printed(60, wide(6))
    tables = len(re.findall("Index", text))
    assert tables >= 2
    assert text.count("Peak velocity 1") == tables


def test_words_wrap_and_leave_figures_their_place():
    said = "on its lower bound, and hardly seen in these recordings; hold the joint still for a while at several angles"
    parameters = (Parameter("load_friction_motoring", "N*m*s/rad", 0.123456, 0.0123, at_bound=True),)
    rows = (("least squares of everything that was recorded", 1234.5, said), ("b", 2.0, ""))
    text = printed(60, ParameterTable("P", parameters), FigureTable("F", ("Method", "RMS (N*m)", "Remark"), rows))
    assert "…" not in text
    assert "0.123" in text
    assert max(map(len, text.splitlines())) <= 60
    assert all(word in text for word in said.split())


def test_a_long_name_cuts_no_figure():
    long = Parameter("optimal_fibre_length.gastrocnemius_lateralis", "1", 0.98402, 0.0612)
    text = printed(80, ParameterTable("P", (long,)))
    assert max(map(len, text.splitlines())) <= 80
    assert {"0.984", "0.120", "6.22"} <= set(text.split())


def test_a_table_without_a_row_is_a_head():
    assert "Method" in printed(80, FigureTable("F", ("Method", "RMS"), ()))


def brief(*tables, verdicts=()):
    result = Result(study="s", headline="It is so.", tables=tables, verdicts=verdicts, rows=(), cards={}, checksums={})
    text = StringIO()
    print_result(Console(width=80, highlight=False, no_color=True, file=text), result, brief=True)
    return text.getvalue()


def test_a_long_result_is_one_screen_and_says_what_is_left_out():
    rows = tuple((f"muscle {i}", float(i)) for i in range(300))
    parameters = tuple(Parameter(f"strength_{i}", "1", 1.0, 0.1) for i in range(100))
    verdicts = (
        *(Verdict("note", f"Remark {i} goes on for a while and says little. " * 6) for i in range(20)),
        Verdict("warning", "Bands are not known to hold."),
    )
    tables = (
        FigureTable("When", ("Muscle", "Onset (s)"), rows, max_brief_rows=15),
        FigureTable("Other", ("Muscle", "End (s)"), rows, max_brief_rows=0),
        ParameterTable("Muscles", parameters, max_brief_rows=0),
    )
    text = brief(*tables, verdicts=verdicts)
    assert len(text.splitlines()) <= 40
    assert "muscle 14 " in text
    assert "muscle 15 " not in text
    assert "Bands are not known to hold." in text
    said = "-v prints 285 further rows, 2 further tables, 17 further remarks, whole sentences as well; the page shows"
    assert said in " ".join(text.split())


def test_a_warning_that_is_cut_keeps_what_to_do():
    remedy = 'Write torque = { delay = "3.0 ms" } in [channels] to move it.'
    rows = tuple((f"m{i}", 0.1) for i in range(300))
    text = brief(
        FigureTable("When", ("Muscle", "Onset (s)"), rows),
        verdicts=(Verdict("warning", "The torque seems to be late. " + "The reasons are many. " * 9, remedy),),
    )
    assert remedy in " ".join(text.replace("\n", " ").split())
    assert "The torque seems to be late." in text
    assert "many. The reasons are many. The reasons are many. The reasons are many." not in " ".join(text.split())


@pytest.mark.parametrize("width", [80, 100])
@pytest.mark.parametrize("count", [1, 12])
def test_a_result_of_any_length_is_one_screen_and_its_first_table_is_whole_before_the_second(width, count):
    rows = tuple((f"index {i}", "a condition", "+2.0 % (at least)", "−13.1 to +19.7 %", "differs") for i in range(9))
    answers = FigureTable("Answers", ("Index", "Condition", "Change", "95 % CI", "Said"), rows)
    many = tuple((f"i{j}", 1.0) for j in range(40))
    others = tuple(FigureTable(f"Other {i}", ("Index", "Mean"), many) for i in range(9))
    verdicts = tuple(Verdict("warning", f"Remark {i} goes on for a while and says little. " * 6) for i in range(20))
    made = [
        Result(study="s", headline="It is so. " * 60, tables=(answers, *others), verdicts=verdicts, rows=(), cards={},
               checksums={}, command="assess", procedure=f"p{i}")
        for i in range(count)
    ]  # fmt: skip
    result = made[0] if count == 1 else CombinedResult.from_parts(made[:2])
    text = StringIO()
    print_result(Console(width=width, highlight=False, no_color=True, file=text), result, brief=True)
    lines = text.getvalue().splitlines()
    assert len(lines) <= SCREEN_LAYOUT.max_screen_lines
    if count == 1:
        assert sum("index " in line for line in lines) == 9
        assert "Remark 19" not in text.getvalue()
    assert "-v prints" in text.getvalue()


def test_a_result_without_long_tables_is_printed_whole():
    verdicts = tuple(Verdict("note", f"Remark {i}.") for i in range(20))
    text = brief(FigureTable("When", ("Muscle", "Onset (s)"), (("soleus", 1.0),)), verdicts=verdicts)
    assert "Remark 19." in text
    assert "-v" not in text


def families(chosen, count=5):
    names = ("symmetric", "directional", "load", "stribeck", "combined", *(f"family {i}" for i in range(5, count)))
    rows = tuple(
        (name, 5 + i, 19.7 - i, 20.1 - i, 0.9, "best" if i == chosen else "") for i, name in enumerate(names[:count])
    )
    heads = ("family", "parameters", "fitted %", "held out %", "held-out R²", "")
    return FigureTable("Friction families, by their errors of the effort", heads, rows, chosen_rows=(chosen,))


@pytest.mark.parametrize("chosen", [0, 4])
@pytest.mark.parametrize("longer", [0, 17])
def test_a_shortened_table_keeps_its_chosen_row_at_every_width(chosen, longer):
    parameters = ParameterTable("P", tuple(Parameter(f"p{i}", "1", 1.0, 0.1) for i in range(longer)))
    errors = FigureTable("Errors by recording", ("recording", "error %"), (("a", 1.0),) * 9)
    tables = parameters, families(chosen), errors
    verdicts = tuple(Verdict("warning", f"Remark {i} goes on for a while and says little. " * 6) for i in range(9))
    result = Result(study="s", headline="It is so.", tables=tables, verdicts=verdicts, rows=(), cards={}, checksums={})
    for width in (40, 60, 80, 100, 140, 200):
        text = StringIO()
        print_result(Console(width=width, highlight=False, no_color=True, file=text), result, brief=True)
        lines = text.getvalue().splitlines()
        assert max(map(len, lines)) <= width
        if any("Friction families" in line for line in lines):
            assert "best" in text.getvalue().split()
            assert tables[1].rows[chosen][0] in text.getvalue().split()


@pytest.mark.parametrize("width", [40, 80, 100, 200])
def test_a_column_without_a_head_may_lose_all_its_cells(width):
    rows = tuple((f"trial {i}", float(i), "fitted" if i > 90 else "") for i in range(100))
    text = StringIO()
    result = Result(study="s", headline="", tables=(FigureTable("Errors", ("Trial", "error %", ""), rows),),
                    verdicts=(), rows=(), cards={}, checksums={})  # fmt: skip
    print_result(Console(width=width, highlight=False, no_color=True, file=text), result, brief=True)
    assert "trial 3" in text.getvalue()
    assert "further rows" in text.getvalue()


@pytest.mark.parametrize("width", [80, 100, 140])
def test_fewer_verdicts_make_room_for_a_chosen_row(width):
    parameters = ParameterTable("P", tuple(Parameter(f"p{i}", "1", 1.0, 0.1) for i in range(12)))
    verdicts = tuple(Verdict("warning", f"Remark {i} goes on for a while and says little. " * 6) for i in range(9))
    result = Result(study="s", headline="It is so.", tables=(parameters, families(4)), verdicts=verdicts, rows=(),
                    cards={}, checksums={})  # fmt: skip
    text = StringIO()
    print_result(Console(width=width, highlight=False, no_color=True, file=text), result, brief=True)
    assert len(text.getvalue().splitlines()) <= SCREEN_LAYOUT.max_screen_lines
    assert {"p11", "combined", "best"} <= set(text.getvalue().split())
    assert "Remark 0" in text.getvalue()


def test_chosen_rows_stand_in_their_own_order_beside_the_first_others():
    table = replace(families(8, count=100), chosen_rows=(8, 60), max_brief_rows=6)
    assert re.findall(r"family \d+", brief(table)) == ["family 8", "family 60"]
    assert {"symmetric", "directional", "load", "stribeck"} <= set(brief(table).split())
    assert "combined" not in brief(table).split()
    assert "-v prints 94 further rows" in " ".join(brief(table).split())
