"""The recipes of `.docs/recipes`: those that can run here run, the others say that they don't and are compiled."""

import ast
import configparser
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
RECIPES = ROOT / ".docs" / "recipes"
NOT_RUN = re.compile(r"[Nn]ot run where silo is tested|[Ww]as not run where silo is tested")
# what each prints; what it needs beside silo; further arguments
RUN = {
    "threads": (r"200 samples of tau, 20 of distance\nat the times of tau: ", (), ()),
    "processes": (r"100 samples of left, 100 of right, ", (), ()),
    "asyncio_loop": (r"400 samples logged, some heard meanwhile\n", (), ()),
    "episodes": (r"3 episodes, the best is \d\nsignal .*\n(.*\n)+5 entries differ (.*), 0 are alike\n", (), ()),
    "added_format": (r"10 samples of height, at most 0\.59 m\n", (), ()),
    "notebook": (r"500 samples, above 1.9 rad/s in \d+ stretches\n", ("matplotlib",), ()),
    "realtime": (r"500 ticks; .*\nlate by \d+ us \(median\), \d+ us \(worst\)\n", (), ()),
    "service": (r"ended in order, \d+ samples saved\n", (), ("0.5",)),
    "mujoco_sim": (r"1000 steps, the hardest contact: \d+ N at ", ("mujoco",), ()),
    "beside_cpp": (r"states are whole: \d+ logged, \d+ came too late", ("g++",), ()),
}
PROGRAMS = sorted(path.stem for path in RECIPES.glob("*.py"))


def head(path: Path) -> str:
    """What a recipe says of itself: the docstring of a program, the comment of another file."""
    text = path.read_text()
    return ast.get_docstring(ast.parse(text)) or "" if path.suffix == ".py" else text


@pytest.mark.slow
@pytest.mark.parametrize("recipe", RUN)
def test_a_recipe_runs(recipe, tmp_path, runtime_folder):
    words, needs, arguments = RUN[recipe]
    for needed in needs:
        if needed == "g++":
            if shutil.which(needed) is None:
                pytest.skip("this computer has no g++")
        else:
            pytest.importorskip(needed)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"}
    command = [sys.executable, str(RECIPES / f"{recipe}.py"), str(tmp_path), *arguments]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.match(words, done.stdout), done.stdout


@pytest.mark.parametrize("recipe", PROGRAMS)
def test_a_recipe_is_a_program_that_says_how_to_run_it(recipe):
    path = RECIPES / f"{recipe}.py"
    compile(path.read_text(), str(path), "exec")
    assert f".docs/recipes/{recipe}.py FOLDER" in head(path)


@pytest.mark.parametrize("recipe", sorted(path.name for path in RECIPES.iterdir() if path.is_file()))
def test_a_recipe_is_run_by_a_test_or_says_that_it_is_not(recipe):
    path = RECIPES / recipe
    assert (path.stem in RUN) != bool(NOT_RUN.search(head(path)))


def test_the_unit_and_the_container_are_files_that_their_readers_take():
    unit = configparser.ConfigParser(strict=False)
    unit.optionxform = str
    unit.read(RECIPES / "silo-robot.service")
    assert unit["Service"]["Type"] == "notify"
    robot = yaml.safe_load((RECIPES / "compose.yaml").read_text())["services"]["robot"]
    assert "/dev/shm/silo-${HOST_UID}:/dev/shm/silo-${HOST_UID}" in robot["volumes"]
    assert "service.py" in robot["command"]
    assert "service.py" in unit["Service"]["ExecStart"]
