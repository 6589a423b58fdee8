"""What programs left that died without saving: found, claimed by one process at a time, saved, and let go of.

Runs in memory (`segments`), what journals prove of them after a power cut (`journals`), and parts of endless recordings
that are open (`parts`); `left` has what is done with any run. For the robot program, the helper process, recorders and
shell commands alike: knows no logger, no helper process and no network.
"""
