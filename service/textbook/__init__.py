"""The textbook: the chapter's exercises and figures, computed by ``filters/textbook/``, as tables and pictures.

A file for each group of exhibits draws them; ``catalogue`` names them all. Drawing needs matplotlib (extra
``textbook``), which is imported when an exhibit is made.
"""
