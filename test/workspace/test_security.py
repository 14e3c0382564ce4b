"""Files of strangers: no code of theirs runs, and no more memory is taken than they are worth."""
import ast
import glob
import json
import os
import pickle
import resource
import stat
import subprocess
import sys
import zipfile

import pytest
import yaml

from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.detection.yolov5.backends import open_runtime
from ros_3d_bb.detection.yolov5.checkpoint import WeightsError, read_checkpoint
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.sessions.session_reader import SessionError, read_session
from ros_3d_bb_lab.evaluation.noise.tables import read_table
from ros_3d_bb_lab.evaluation.tracking.trajectories import read_sequence
from ros_3d_bb_lab.simulation.scenario import read_scenario

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BOMB = 'a: &a [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    '%s: &%s [%s]\n' % (name, name, ', '.join(['*' + before] * 9)) for before, name in zip('abcdefgh', 'bcdefghi'))
ATTACKS = ['!!python/object/apply:os.system ["touch MARK"]', '!!python/name:os.system', '!!python/module:os',
           '!!python/object/new:os.system ["touch MARK"]', BOMB, '[' * 100000, '{a: ' * 50000, '&a [*a]', '9' * 10 ** 5,
           '2001-13-45', '\x00', '? [a]\n: 1']


def beginnings(texts):
    return [repr(text[:12]) for text in texts]


def sources():
    return [path for folder in ('src', 'annotator', 'scripts') for path in sorted(
        glob.glob(os.path.join(ROOT, folder, '**', '*'), recursive=True)) if os.path.isfile(path)
        and (path.endswith('.py') or not os.path.splitext(path)[1])]


def calls_in(path):
    """Dotted names of what a file calls."""
    with open(path) as stream:
        tree = ast.parse(stream.read())
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            function, names = node.func, []
            while isinstance(function, ast.Attribute):
                names.insert(0, function.attr)
                function = function.value
            yield '.'.join([function.id if isinstance(function, ast.Name) else '?'] + names)


def test_nothing_runs_what_it_reads():
    forbidden = {'eval', 'exec', 'compile', 'pickle.load', 'pickle.loads', 'torch.load', 'os.system', 'os.popen',
                 'yaml.unsafe_load', 'yaml.full_load', 'yaml.load_all', 'yaml.safe_load', 'numpy.load', 'np.load'}
    assert len(sources()) > 100
    for path in sources():
        allowed = {'yaml.load'} if path.endswith('yaml_loader.py') else set()
        assert not set(calls_in(path)) & (forbidden | {'yaml.load'}) - allowed, path


@pytest.fixture
def little_memory():
    """A fault is a MemoryError, and not a machine that stands still."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    with open('/proc/self/statm') as stream:
        used = int(stream.read().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (used + 2 ** 29, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_DATA, before)


@pytest.mark.parametrize('read,refusals', [(read_error_model, ValueError), (read_scenario, ValueError)])
@pytest.mark.parametrize('attack', ATTACKS, ids=beginnings(ATTACKS))
def test_hostile_yaml_is_refused(tmp_path, little_memory, attack, read, refusals):
    path, mark = tmp_path / 'file.yaml', tmp_path / 'mark'
    path.write_text(attack.replace('MARK', str(mark)))
    with pytest.raises(refusals) as refused:
        read(str(path))
    assert not mark.exists() and len(str(refused.value)) < 10 ** 6


def test_yaml_that_is_meant_is_read():
    assert load_yaml('a: [1, 2.5, x]\nb: {c: true}') == {'a': [1, 2.5, 'x'], 'b': {'c': True}}
    with pytest.raises(yaml.YAMLError, match='alias'):
        load_yaml(BOMB)


SESSIONS = ['[' * 100000, '{"frames":' * 50000, '{"frames": %s}' % ('[' * 5000 + ']' * 5000),
            '{"frames": [%s]}' % ('9' * 10 ** 5), '{"frames": 1e999}', '"frames"', '\x00',
            json.dumps({'camera': {}, 'frames': [{'detections': [[]] * 1000}]})]


@pytest.mark.parametrize('text', SESSIONS, ids=beginnings(SESSIONS))
def test_hostile_json_is_refused(tmp_path, little_memory, text):
    (tmp_path / 'frames.json').write_text(text)
    with pytest.raises(SessionError):
        read_session(str(tmp_path))


TABLES = ['', 'a', 't_s,id,x_m,y_m\n' + '=cmd|calc,1,2,3\n', 't_s,id,x_m,y_m\n1,1,nan,1e999\n', '"' * 10 ** 6,
          'x true,x measured\n' + '9' * 10 ** 6, '\x00' * 100, '"a\n' * 1000]


@pytest.mark.parametrize('text', TABLES, ids=beginnings(TABLES))
def test_hostile_tables_are_refused(tmp_path, little_memory, text):
    path = tmp_path / 'table.csv'
    path.write_text(text)
    for read in (lambda: read_table(str(path), 'x'), lambda: read_sequence(str(path))):
        with pytest.raises(ValueError):
            read()


class Attack(object):
    """What a pickle of it does when it is read."""

    def __init__(self, command):
        self._command = command

    def __reduce__(self):
        return os.system, (self._command,)


def test_hostile_checkpoints_are_refused(tmp_path, little_memory):
    mark = tmp_path / 'mark'
    contents = [pickle.dumps(Attack('touch %s' % mark), 2), b'cos\nsystem\n(S"touch %s"\ntR.' % str(mark).encode(),
                b'cbuiltins\neval\n(S"1"\ntR.', b'(' * 10 ** 6 + b'.', b'\x80\x04\x8e' + b'\xff' * 8 + b'.',
                b'X\xff\xff\xff\x7f.', b'(lp0\n' + b'g0\na' * 1000 + b'.']
    for content in contents:
        with zipfile.ZipFile(str(tmp_path / 'weights.pt'), 'w') as archive:
            archive.writestr('archive/data.pkl', content)
        with pytest.raises(WeightsError):
            read_checkpoint(str(tmp_path / 'weights.pt'))
    assert not mark.exists()


MODELS = [b'', b'\x08\x07' * 1000, b'\x3a\xff\xff\xff\xff\x0f', bytes(range(256)) * 40, b'(' * 10 ** 6]


@pytest.mark.needs('onnxruntime')
@pytest.mark.parametrize('content', MODELS, ids=beginnings(MODELS))
def test_hostile_onnx_files_are_refused(tmp_path, content):
    path = tmp_path / 'weights.onnx'
    path.write_bytes(content)
    with pytest.raises(WeightsError, match='not a YOLOv5 ONNX export'):
        open_runtime(str(path))


def test_files_are_written_with_the_rights_that_the_user_wants(tmp_path):
    for mask in (0o077, 0o022, 0o002):
        before = os.umask(mask)
        try:
            atomic_write(str(tmp_path / 'file'), b'x')
        finally:
            os.umask(before)
        assert stat.S_IMODE(os.stat(str(tmp_path / 'file')).st_mode) == 0o666 & ~mask


def test_reading_a_hostile_file_writes_nothing(tmp_path):
    """A program of its own, whose folder is watched."""
    (tmp_path / 'model.yaml').write_text(ATTACKS[0])
    program = 'from ros_3d_bb.estimation.error_model import read_error_model; read_error_model("model.yaml")'
    result = subprocess.run([sys.executable, '-c', program], cwd=str(tmp_path), stderr=subprocess.PIPE)
    assert result.returncode == 1 and b'ValueError' in result.stderr and os.listdir(str(tmp_path)) == ['model.yaml']
