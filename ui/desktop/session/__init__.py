"""What the window knows, without a toolkit: open case, steps, jobs, edits."""
