"""Interactive viewer of a light field: one page of HTML that holds the views."""
