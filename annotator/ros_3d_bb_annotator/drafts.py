"""What was typed but not yet entered, kept in a file beside the session, so that a crash does not lose it."""
import contextlib
import json
import os

from ros_3d_bb.session_file import write_whole

FILE_NAME = '.annotator_draft.json'


class Drafts(object):
    """The drafts of a session: for the id of a measurement, its fields and their text. The file is there as long as
    there are any.
    """

    def __init__(self, folder):
        self._path = os.path.join(folder, FILE_NAME)
        self._fields = _read(self._path)

    def of(self, name):
        """The fields {name: text} of a measurement; empty where there are none."""
        return dict(self._fields.get(name, {}))

    def set(self, name, fields):
        """Keep the fields of a measurement; none, or only empty ones, remove its draft. Raises OSError."""
        fields = {key: text for key, text in fields.items() if text}
        if fields == self._fields.get(name, {}):
            return
        self._fields[name] = fields
        if not fields:
            del self._fields[name]
        if self._fields:
            write_whole(self._path, json.dumps(self._fields).encode())
        else:
            with contextlib.suppress(FileNotFoundError):
                os.remove(self._path)


def _read(path):
    """The drafts of a file; none where it cannot be read, as there is nothing to be saved in it then."""
    try:
        with open(path, encoding='utf-8') as stream:
            content = json.load(stream)
        return {str(name): {str(key): str(text) for key, text in fields.items()} for name, fields in content.items()}
    except (OSError, ValueError, AttributeError, RecursionError):
        return {}
