"""The element table and edits of it, scripts, and views of the terminal beside them: what is asked."""
