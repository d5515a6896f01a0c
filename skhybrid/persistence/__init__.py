"""Model files that hold only data: reading a file executes nothing in it.

A file is one line of text, with the version and a checksum, followed by a ``skops`` archive.  pandas objects and those
of this package are written as plain data, so a file can only name these types and those that ``skops`` itself trusts.
"""

from .model_file import load_metadata, load_model, load_model_and_metadata, save_model

__all__ = ["load_metadata", "load_model", "load_model_and_metadata", "save_model"]
