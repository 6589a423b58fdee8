"""Parts of endless recordings: bags that are read whole, open, or cut short."""
