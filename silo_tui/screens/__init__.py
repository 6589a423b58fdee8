"""The screens and dialogs: they compose widgets and carry out the commands that concern what is on them.

They reach the app through `silo_tui.context` alone. What takes several steps with questions in between belongs to
`commands`, which imports this, as the app does.
"""
