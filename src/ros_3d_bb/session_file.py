"""Write the frames.json of a measurement session: whole or not at all, and one program at a time."""
import contextlib
import fcntl
import json
import os
import tempfile

FILE_NAME = 'frames.json'


@contextlib.contextmanager
def changing(folder):
    """Hold the description of a session and write it when the block ends without an error.

    Another program that does the same waits meanwhile, so the viewer may add measurements to a session that is being
    annotated. The file is replaced as a whole: who is killed leaves the old one or the new one.

    Parameters
    ----------
    folder : str
        An existing folder.

    Yields
    ------
    dict
        The content of frames.json, to be changed in place; {'frames': []} where there is none yet.

    Raises
    ------
    OSError
        If the folder cannot be read or written.
    ValueError
        If frames.json holds something else than the description of a session.
    """
    path = os.path.join(str(folder), FILE_NAME)
    with open(os.path.join(str(folder), '.lock'), 'a') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        content = _read(path)
        yield content
        write_whole(path, _text_of(content).encode())


def write_whole(path, data):
    """Write the bytes `data` to `path`, which holds afterwards either what it held before or all of `data`."""
    descriptor, temporary = tempfile.mkstemp(dir=os.path.dirname(path), prefix='.', suffix='.tmp')
    try:
        with os.fdopen(descriptor, 'wb') as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)  # mkstemp lets nobody else read it
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def _text_of(content):
    """A line for each field and each frame, for people to read; quick for thousands of frames, as an indented dump is
    not. Raises ValueError for nan and inf.
    """
    frames = ',\n'.join(' ' + json.dumps(frame, allow_nan=False) for frame in content['frames'])
    fields = ['%s: %s' % (json.dumps(str(key)), json.dumps(value, allow_nan=False))
              for key, value in content.items() if key != 'frames']
    return '{\n%s\n}\n' % ',\n'.join(fields + ['"frames": [\n%s\n]' % frames])


def _read(path):
    if not os.path.exists(path):
        return {'frames': []}
    with open(path, encoding='utf-8') as stream:
        content = json.load(stream)
    if not isinstance(content, dict) or not isinstance(content.get('frames'), list):
        raise ValueError('%s: not the description of a measurement session; an object with frames expected' % path)
    return content
