"""The compilers' stand-in of the tests: the same is compiled once, anything else again, and failures stay failures."""

import shutil
import subprocess

import pytest
from shared_compiler import install_stand_ins

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="cc is not installed")


@pytest.fixture
def compile_(tmp_path):
    """Compile FOLDER/main.c through a stand-in of its own; return the status, and how many results are kept."""
    install_stand_ins(tmp_path / "bin", tmp_path / "kept")

    def run(folder, *options):
        command = [str(tmp_path / "bin" / "cc"), *options, "-I.", "-c", "main.c", "-o", "main.o"]
        status = subprocess.run(command, cwd=folder, capture_output=True).returncode
        return status, len([path for path in (tmp_path / "kept").iterdir() if not path.suffix])

    return run


def write(folder, number):
    folder.mkdir(exist_ok=True)
    (folder / "pellucid_controller.h").touch()
    (folder / "number.h").write_text(f"enum {{ number = {number} }};\n", encoding="utf-8")
    (folder / "main.c").write_text('#include "number.h"\nint main(void) { return number; }\n', encoding="utf-8")
    return folder


def test_the_same_content_is_compiled_once_and_other_content_again(compile_, tmp_path):
    first, second = write(tmp_path / "first", 1), write(tmp_path / "second", 1)
    assert compile_(first) == (0, 1)
    assert compile_(second) == (0, 1)
    assert (first / "main.o").read_bytes() == (second / "main.o").read_bytes()
    assert compile_(second, "-O2") == (0, 2)
    assert compile_(write(second, 2)) == (0, 3)  # a header differs
    assert (first / "main.o").read_bytes() != (second / "main.o").read_bytes()


def test_what_does_not_compile_fails_every_time(compile_, tmp_path):
    folder = write(tmp_path / "wrong", "no_number")
    assert [compile_(folder) for _ in range(2)] == [(1, 0), (1, 0)]
    assert not (folder / "main.o").exists()


def test_nothing_is_kept_of_what_is_no_exported_controller(compile_, tmp_path):
    folder = write(tmp_path / "other", 1)
    (folder / "pellucid_controller.h").unlink()
    assert compile_(folder) == (0, 0)
    assert (folder / "main.o").exists()
