"""Atomic writing of files, and locked updates of the frames.json of a measurement session."""
import contextlib
import fcntl
import json
import os
import tempfile

FILE_NAME = 'frames.json'


@contextlib.contextmanager
def locked_update(folder):
    """Lock the description of a session in an existing folder, and write it when the block ends without an error.

    Other programs wait for the lock, so that the viewer can add measurements to a session that is being annotated.
    Yields the content of frames.json, a dict to be modified in place; {'frames': []} if the file does not exist. Raises
    OSError if the folder cannot be read or written, and ValueError if frames.json is not the description of a session,
    or the new content has nan or inf.
    """
    path = os.path.join(str(folder), FILE_NAME)
    with open(os.path.join(str(folder), '.lock'), 'a') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        content = _read(path)
        yield content
        atomic_write(path, _text_of(content).encode())


def atomic_write(path, data):
    """Write the bytes `data` to `path` atomically: after an error or a crash the old content is intact."""
    descriptor, temporary = tempfile.mkstemp(dir=os.path.dirname(path), prefix='.', suffix='.tmp')
    try:
        with os.fdopen(descriptor, 'wb') as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)  # mkstemp permits only the owner to read it
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def _text_of(content):
    """Format a description with one line per field and frame: readable, and faster than an indented dump."""
    frames = ',\n'.join(' ' + json.dumps(frame, allow_nan=False) for frame in content['frames'])
    fields = ['%s: %s' % (json.dumps(str(key)), json.dumps(value, allow_nan=False))
              for key, value in content.items() if key != 'frames']
    return '{\n%s\n}\n' % ',\n'.join(fields + ['"frames": [\n%s\n]' % frames])


def _read(path):
    if not os.path.exists(path):
        return {'frames': []}
    with open(path, encoding='utf-8') as stream:
        try:
            content = json.load(stream)
        except ValueError as error:
            raise ValueError('%s: not the description of a measurement session (%s)' % (path, error))
    if not isinstance(content, dict) or not isinstance(content.get('frames'), list):
        raise ValueError('%s: not the description of a measurement session; an object with frames expected' % path)
    return content
