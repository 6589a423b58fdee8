# %% [markdown]
"""Jupyter: log, look, plot, in cells. As a notebook: `jupytext --to ipynb notebook.py`, or open it in VS Code.

A cell that runs twice makes the logger anew: the first one of that name is saved and closed by itself. Loggers, logs,
signals and clients show themselves as tables.

    python .docs/recipes/notebook.py FOLDER
"""

# %% a logger, some ticks
import sys

import numpy as np

import silo

folder = sys.argv[1] if len(sys.argv) == 2 else "."
log = silo.Logger("notebook", frequency=100, folder=folder)
q = log.array("q", 3, group="joints", unit="rad")
log.start()
for tick in range(500):
    q[:] = np.sin(0.02 * tick + np.arange(3))
    log.collect()
log.stop()
log  # noqa: B018 - the last line of a cell is shown: a table of the elements

# %% what was logged, without a file in between
log["joints/q"]  # options, newest value, samples held

# %% saved, and read again
saved = log.save("silo")
log.close()
run = silo.open_log(saved[0].path)
run["joints/q"]  # shape, unit, minimum and maximum of each column

# %% signals are arrays that know their unit and time
speed = run["joints/q"].derivative()
fast = np.abs(speed[:, 0]) > 1.9
print(f"{len(run['joints/q'])} samples, above 1.9 {speed.unit} in {len(fast.when())} stretches")

# %% a picture: `%matplotlib inline` shows it below the cell; here it becomes a file
run["joints/q"].to("deg").plot(path=f"{folder}/q.png")
