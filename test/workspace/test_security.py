import glob
import json
import os
import re
import resource
import zipfile

import pytest
import yaml

from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.detection.weights import WeightsError
from ros_3d_bb.detection.yolov5.checkpoint import read_checkpoint
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.sessions.session_reader import SessionError, read_session
from ros_3d_bb_lab.simulation.scenario import read_scenario

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BOMB = 'a: &a [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    '%s: &%s [%s]\n' % (name, name, ', '.join(['*' + before] * 9)) for before, name in zip('abcdefgh', 'bcdefghi'))
ATTACKS = ['!!python/object/apply:os.system ["touch MARK"]', '!!python/name:os.system', BOMB, '[' * 100000,
           '{a: ' * 50000, '&a [*a]', '9' * 10 ** 5, '2001-13-45', '\x00', '? [a]\n: 1']


def start_of(content):
    return repr(content[:12]) if isinstance(content, (bytes, str)) else None


def test_no_function_that_executes_its_input_is_called():
    forbidden = re.compile(r'(?<![\w.])(eval|exec|compile|pickle\.loads?|torch\.load|os\.system|os\.popen|np\.load'
                           r'|yaml\.(unsafe_|full_|safe_)?load(_all)?)\(')
    paths = [path for folder in ('src', 'annotator', 'scripts')
             for path in glob.glob(os.path.join(ROOT, folder, '**', '*'), recursive=True)
             if os.path.isfile(path) and os.path.splitext(path)[1] in ('.py', '')]
    assert len(paths) > 100
    for path in paths:
        with open(path) as stream:
            found = set(match.group() for match in forbidden.finditer(stream.read()))
        assert found <= ({'yaml.load('} if path.endswith('yaml_loader.py') else set()), path


@pytest.fixture
def little_memory():
    """Limit the memory, so that a failure is a MemoryError and does not affect the machine."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    with open('/proc/self/statm') as stream:
        used = int(stream.read().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (used + 2 ** 29, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_DATA, before)


@pytest.mark.parametrize('read', [read_error_model, read_scenario])
@pytest.mark.parametrize('attack', ATTACKS, ids=start_of)
def test_malicious_yaml_is_rejected(tmp_path, little_memory, attack, read):
    path, mark = tmp_path / 'file.yaml', tmp_path / 'mark'
    path.write_text(attack.replace('MARK', str(mark)))
    with pytest.raises(ValueError) as error:
        read(str(path))
    assert sorted(tmp_path.iterdir()) == [path] and len(str(error.value)) < 10 ** 6


def test_valid_yaml_is_read_except_for_aliases():
    assert load_yaml('a: [1, 2.5, x]\nb: {c: true}') == {'a': [1, 2.5, 'x'], 'b': {'c': True}}
    with pytest.raises(yaml.YAMLError, match='alias'):
        load_yaml(BOMB)


@pytest.mark.parametrize('text', [
    '[' * 100000, '{"frames":' * 50000, '{"frames": %s}' % ('[' * 5000 + ']' * 5000),
    '{"frames": [%s]}' % ('9' * 10 ** 5), '{"frames": 1e999}', '"frames"', '\x00',
    json.dumps({'camera': {}, 'frames': [{'detections': [[]] * 1000}]})], ids=start_of)
def test_malicious_json_is_rejected(tmp_path, little_memory, text):
    (tmp_path / 'frames.json').write_text(text)
    with pytest.raises(SessionError):
        read_session(str(tmp_path))


@pytest.mark.parametrize('content', [
    b'cposix\nsystem\nq\x00U\x0atouch markq\x01\x85q\x02Rq\x03.', b'cos\nsystem\n(S"touch mark"\ntR.',
    b'cbuiltins\neval\n(S"1"\ntR.', b'(' * 10 ** 6 + b'.', b'\x80\x04\x8e' + b'\xff' * 8 + b'.',
    b'X\xff\xff\xff\x7f.', b'(lp0\n' + b'g0\na' * 1000 + b'.'], ids=start_of)
def test_malicious_checkpoints_are_rejected(tmp_path, monkeypatch, little_memory, content):
    monkeypatch.chdir(tmp_path)
    with zipfile.ZipFile('weights.pt', 'w') as archive:
        archive.writestr('archive/data.pkl', content)
    with pytest.raises(WeightsError):
        read_checkpoint('weights.pt')
    assert os.listdir('.') == ['weights.pt']
