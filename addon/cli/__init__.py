"""Arguments, exit codes and one-line errors; the work is in `app`."""
