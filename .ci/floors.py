#!/usr/bin/env python3
"""Install silo with all that it can use, at the lowest versions that it names and at the newest, and let it work.

    python .ci/floors.py [--python 3.12] [--resolution lowest-direct]

Needs `uv`, and the interpreters: `pythonX.Y` of the path, those of pyenv, and what uv has. One that can't be had is
skipped, and that is said. No package may be built: a floor without a wheel for a Python is one that doesn't install.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PYTHONS = ("3.10", "3.11", "3.12", "3.13")
RESOLUTIONS = ("lowest-direct", "highest")
EXTRAS = "analysis,bags,convert,plot,web"


def interpreter(version: str) -> str:
    """Return one that runs and is of this version, or nothing."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    there = [shutil.which(f"python{version}"), *sorted(pyenv.glob(f"{version}.*/bin/python"), reverse=True)]
    for path in filter(None, there):
        asked = run([str(path), "-c", "import sys; print('%d.%d' % sys.version_info[:2])"])
        if asked.stdout.strip() == version:
            return str(path)
    return run(["uv", "python", "find", version]).stdout.strip()


def run(command: list[str], **more: str) -> subprocess.CompletedProcess[str]:
    """Run to the end, whatever becomes of it."""
    environment = {**os.environ, **more}
    environment.pop("PYTHONPATH", None)  # the installed silo is meant
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, cwd=tempfile.gettempdir()
    )


def tried(wheel: Path, python: str, resolution: str, folder: Path) -> str:
    """Return what failed, empty for nothing."""
    environment, smoke = folder / "venv", folder / "smoke"
    smoke.mkdir(parents=True)
    own = environment / "bin" / "python"
    steps = {
        "venv": ["uv", "venv", "-q", "--python", python, str(environment)],
        "install": [
            "uv", "pip", "install", "-q", "--python", str(own), "--resolution", resolution, "--only-binary", ":all:",
            f"silo-logger[{EXTRAS}] @ {wheel.as_uri()}",
        ],
        "smoke test": [str(own), str(ROOT / ".ci" / "smoke.py"), str(smoke)],
    }  # fmt: skip
    runtime = Path(tempfile.mkdtemp(prefix="silo-", dir="/dev/shm"))
    try:
        for step, command in steps.items():
            done = run(command, SILO_RUNTIME_DIR=str(runtime))
            if done.returncode:
                return f"{step}:\n{done.stdout}{done.stderr}"
    finally:
        shutil.rmtree(runtime, ignore_errors=True)
    return ""


def main() -> int:
    """Return 1 where something failed or nothing could be tried."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", choices=PYTHONS, action="append", help="only this one (repeatable)")
    parser.add_argument("--resolution", choices=RESOLUTIONS, action="append", help="only this one (repeatable)")
    wanted = parser.parse_args()
    if shutil.which("uv") is None:
        print("floors: uv is missing: pip install uv")
        return 1
    failed, count = 0, 0
    with tempfile.TemporaryDirectory() as folder:
        built = run(["uv", "build", "-q", "--wheel", "--python", sys.executable, "-o", folder, str(ROOT)])
        if built.returncode:
            print(f"floors: the wheel can't be built:\n{built.stderr}")
            return 1
        wheel = next(Path(folder).glob("*.whl"))
        for version in wanted.python or PYTHONS:
            python = interpreter(version)
            if not python:
                print(f"Python {version}: skipped, there is none here", flush=True)
                continue
            for resolution in wanted.resolution or RESOLUTIONS:
                begin_s = time.monotonic()
                why = tried(wheel, python, resolution, Path(folder) / f"{version}-{resolution}")
                failed += bool(why)
                count += 1
                verdict = f"failed at {why}" if why else f"well, {time.monotonic() - begin_s:.0f} s"
                print(f"Python {version}, {resolution}: {verdict}", flush=True)
    return int(bool(failed) or not count)


if __name__ == "__main__":
    sys.exit(main())
