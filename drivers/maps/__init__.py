"""Maps from files, in the frame that is used inside: north, east, down."""
