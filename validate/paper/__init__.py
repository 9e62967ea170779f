"""The paper's studies on a finer mesh of another element."""
