"""Atomic writing of files."""
import os
import tempfile


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
