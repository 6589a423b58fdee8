"""The screens and dialogs of silo-tui. They compose widgets and call the app; they hold no data of their own."""
