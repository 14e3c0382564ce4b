"""Which processes there are."""
import os


def processes_naming(text):
    """How many processes have a text in their command line."""
    found = 0
    for pid in filter(str.isdigit, os.listdir('/proc')):
        try:
            with open('/proc/%s/cmdline' % pid) as stream:
                found += text in stream.read()
        except OSError:
            pass  # it ended meanwhile
    return found
