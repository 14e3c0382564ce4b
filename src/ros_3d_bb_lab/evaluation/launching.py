"""Launch files and other programs, which are ended in any case."""
import contextlib
import json
import os
import signal
import socket
import subprocess

ENDING_S = 40.0  # roslaunch waits up to 17 s for its nodes


def recorded(name, arguments, path, timeout_s):
    """Run a launch file of the package, with a dictionary of arguments, until it exits or times out, unless it was run
    before. Returns what it has recorded in `path`.json.

    Raises RuntimeError, with the end of the log, if it has not.
    """
    if not os.path.exists(path + '.json'):
        command = ['ros_3d_bb', name] + ['%s:=%s' % item for item in dict(arguments, record=path + '.json').items()]
        with open(path + '.log', 'w') as log, running_roslaunch(command, free_port(), log) as process, \
                contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout_s)
    try:
        with open(path + '.json') as stream:
            return json.load(stream)
    except OSError:
        with open(path + '.log') as stream:
            end = stream.read()[-3000:]
        raise RuntimeError('%s: no result. The end of the log:\n%s' % (os.path.basename(path), end))


def running_roslaunch(arguments, port, log):
    """Context in which roslaunch runs with its own master."""
    return running(['roslaunch', '-p', str(port)] + arguments, stdout=log, stderr=subprocess.STDOUT,
                   env=dict(os.environ, ROS_MASTER_URI='http://localhost:%d' % port))


@contextlib.contextmanager
def running(command, **options):
    """Context in which a program runs, with options of Popen. At the end, it gets a Ctrl-C, and is then killed.

    It runs in a separate session, so that a Ctrl-C in the terminal reaches it only once, through this function.
    """
    process = subprocess.Popen(command, start_new_session=True, **options)
    try:
        yield process
    finally:
        for number, timeout_s in (signal.SIGINT, ENDING_S), (signal.SIGKILL, None):
            with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
                os.killpg(process.pid, number)
                process.wait(timeout_s)


def free_port():
    with contextlib.closing(socket.socket()) as probe:
        probe.bind(('localhost', 0))
        return probe.getsockname()[1]
