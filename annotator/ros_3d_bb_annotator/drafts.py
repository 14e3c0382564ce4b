"""Text that was typed in an annotator but not entered. It is kept in a file of the session and survives a crash."""
import json
import os

from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.sessions.session_reader import SessionError

FILE_NAME = '.annotator_draft.json'  # exists while there are drafts


class Drafts(object):
    """Drafts of the session in a folder: {name of a field: text} by the ID of the measurement."""

    def __init__(self, folder):
        self._path = os.path.join(folder, FILE_NAME)
        self._drafts = _read(self._path)

    def of(self, name):
        return dict(self._drafts.get(name, {}))

    def set(self, name, fields):
        """Save the draft of a measurement. Empty fields are removed. Raises SessionError."""
        fields = {key: text for key, text in fields.items() if text}
        if fields == self.of(name):
            return
        self._drafts[name] = fields
        used = {other: texts for other, texts in self._drafts.items() if texts}
        try:
            if used:
                atomic_write(self._path, json.dumps(used).encode())
            elif os.path.exists(self._path):
                os.remove(self._path)
        except OSError as error:
            raise SessionError('%s: the typed text cannot be saved (%s)' % (self._path, error.strerror))


def _read(path):
    """Content of the file; {} if it cannot be read."""
    try:
        with open(path, encoding='utf-8') as stream:
            content = json.load(stream)
        return {str(name): {str(key): str(text) for key, text in fields.items()} for name, fields in content.items()}
    except (OSError, ValueError, AttributeError, RecursionError):
        return {}
