"""The module's logic without a GUI: calls the palpate program in a child process and shows what it wrote as MRML nodes."""
