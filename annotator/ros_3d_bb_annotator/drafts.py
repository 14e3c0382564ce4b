"""Text that was typed but not entered. It is saved in a file in the session's folder, so that it survives a crash."""
import json
import os

from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.sessions.session_reader import SessionError

FILE_NAME = '.annotator_draft.json'


class Drafts(object):
    """Drafts of a session: the text of each field by ID of the measurement. The file exists while there are drafts."""

    def __init__(self, folder):
        self._path = os.path.join(folder, FILE_NAME)
        self._fields = _read(self._path)

    def of(self, name):
        """Draft of a measurement, {name of a field: text}; {} if there is none."""
        return dict(self._fields.get(name, {}))

    def set(self, name, fields):
        """Save the draft of a measurement. If all fields are empty, the draft is removed. Raises SessionError."""
        fields = {key: text for key, text in fields.items() if text}
        if fields == self._fields.get(name, {}):
            return
        self._fields[name] = fields
        if not fields:
            del self._fields[name]
        try:
            if self._fields:
                atomic_write(self._path, json.dumps(self._fields).encode())
            elif os.path.exists(self._path):
                os.remove(self._path)
        except OSError as error:
            raise SessionError('%s: the typed text cannot be saved (%s)' % (self._path, error.strerror))


def _read(path):
    """Read the drafts in a file; {} if it cannot be read."""
    try:
        with open(path, encoding='utf-8') as stream:
            content = json.load(stream)
        return {str(name): {str(key): str(text) for key, text in fields.items()} for name, fields in content.items()}
    except (OSError, ValueError, AttributeError, RecursionError):
        return {}
