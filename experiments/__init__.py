"""The programs: each module here is one command or one study. Nothing else may import them."""
