"""Label volumes of the open case: strokes and their undo, whole-label operations, statistics, the journal on disk."""
