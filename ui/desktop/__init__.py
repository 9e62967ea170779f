"""The desktop window: logic that knows no toolkit, and thin Qt widgets over it."""
