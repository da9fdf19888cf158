"""The parts of a proof: their rows in order, each called in its turn, and what is said of the time that each took."""

from research.evidence._parts import run_parts


def test_each_part_is_called_in_its_turn_and_said_to_have_ended(capsys):
    called = []

    def part(name, rows):
        called.append(name)
        yield from rows

    made = run_parts("proof", {"first": lambda: part("a", [1, 2]), "second": lambda: part("b", [3])})
    assert next(made) == 1
    assert called == ["a"]
    assert capsys.readouterr().err == ""
    assert next(made) == 2
    assert next(made) == 3
    assert capsys.readouterr().err == "proof: first ended after 0 s, 0 s in all\n"
    assert list(made) == []
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", "proof: second ended after 0 s, 0 s in all\n")
