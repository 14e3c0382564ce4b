"""Launch files and other programs, which are ended in any case."""
import contextlib
import os
import signal
import socket
import subprocess

ENDING_S = 40.0  # roslaunch waits up to 17 s for its nodes


def launch(name, arguments, timeout_s, log):
    """Run a launch file of the package, with a dictionary of arguments, until it exits or times out."""
    command = ['ros_3d_bb', name] + ['%s:=%s' % item for item in arguments.items()]
    with running_roslaunch(command, free_port(), log) as process, \
            contextlib.suppress(subprocess.TimeoutExpired):  # the caller reports the missing result
        process.wait(timeout_s)


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
    """TCP port that is not in use."""
    with contextlib.closing(socket.socket()) as probe:
        probe.bind(('localhost', 0))
        return probe.getsockname()[1]
