"""Episodes: named stretches of a run, which went well or not, told by marks."""
