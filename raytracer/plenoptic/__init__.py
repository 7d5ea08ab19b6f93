"""Light fields as data: where the views are, what each saw, and the file that holds them."""
