import io
import pickle
import re
import zipfile

import numpy as np
import pytest

from ros_3d_bb.detection.weights import WeightsError
from ros_3d_bb.detection.yolov5.checkpoint import EXPECTED, read_checkpoint
from ros_3d_bb.detection.yolov5.network import Network
from support.checkpoints import write_checkpoint
from support.layouts import layout

LAYOUT = layout('6.0', 'n', 3)


@pytest.fixture
def path(tmp_path):
    return str(tmp_path / 'weights.pt')


@pytest.fixture(scope='module')
def content(tmp_path_factory):
    path = tmp_path_factory.mktemp('weights') / 'weights.pt'
    write_checkpoint(str(path), LAYOUT)
    return path.read_bytes()


def write(path, content):
    with open(path, 'wb') as stream:
        stream.write(content)


def write_pickle(path, pickled, compression=zipfile.ZIP_STORED):
    """A zip archive as torch writes it: a pickle, and a storage of 16 bytes."""
    with zipfile.ZipFile(path, 'w', compression) as archive:
        archive.writestr('archive/data.pkl', pickled)
        archive.writestr('archive/data/0', b'\0' * 16)


@pytest.mark.parametrize('release,model,root', [('6.0', 'n', 'Model'), ('6.0', 'n6', 'DetectionModel'),
                                                ('5.0', 's', 'Model')])
def test_reads_weights_layout_and_names(path, release, model, root):
    state = write_checkpoint(path, layout(release, model), root=root).state_dict()
    read, names, weights = read_checkpoint(path)
    assert read == layout(release, model) and names[0] == 'person' and len(names) == 80
    assert set(weights) == set(state)
    for name, tensor in state.items():
        np.testing.assert_array_equal(weights[name].astype(np.float32), tensor.numpy().astype(np.float32))


@pytest.mark.parametrize('module,name', [('builtins', 'eval'), ('torch', 'load'), ('subprocess', 'Popen'),
                                         ('torch._utils', '_rebuild_device_tensor_from_numpy'), ('modelsx', 'Model')])
def test_names_outside_the_allow_list_are_rejected(path, module, name):
    write_pickle(path, b'c%s\n%s\n.' % (module.encode(), name.encode()))
    with pytest.raises(WeightsError, match=re.escape('%s.%s' % (module, name))):
        read_checkpoint(path)


@pytest.mark.parametrize('name', ['ultralytics.nn.tasks DetectionModel', 'ultralytics.nn.modules.block C2f'])
def test_the_error_for_ultralytics_models_is_how_to_export_them(path, name):
    """YOLOv8 and later contain pickled code, of which nothing is imported."""
    write_pickle(path, b'c%s\n%s\n)R.' % tuple(name.encode().split()))
    with pytest.raises(WeightsError, match=r'"yolo export model=weights\.pt format=onnx"'):
        read_checkpoint(path)


@pytest.mark.parametrize('name', ['models.common', 'numpy.core.multiarray', 'pathlib'])
def test_allowed_modules_are_replaced_by_stand_ins(path, name):
    """Nothing is called; the error is that the file contains no model."""
    write_pickle(path, b'c%s\nsystem\n(S"exit 1"\ntR.' % name.encode())
    with pytest.raises(WeightsError, match=r'models\.yolo\.Model'):
        read_checkpoint(path)


STORAGE = b'(X\x07\0\0\0storagectorch\nFloatStorage\nX\1\0\0\x000X\3\0\0\0cpuK\1tQ'
REBUILD = b'ctorch._utils\n_rebuild_tensor_v2\n('


def tensor(storage=STORAGE, offset=b'K\0', size=b'(K\4t', stride=b'(K\1t'):
    """Pickle of a tensor, by default of four floats that fill the storage."""
    return REBUILD + storage + offset + size + stride + b'\x89NtR'


@pytest.mark.parametrize('change, named', [
    ({}, r'models\.yolo\.Model'),  # the tensor is valid, but the file contains no model
    ({'size': b'(K\5t'}, 'exceeds'), ({'offset': b'J\xff\xff\xff\xff'}, 'exceeds'), ({'stride': b'(K\2t'}, 'exceeds'),
    # a view with a stride of 0 is larger than its memory
    ({'storage': tensor(size=b'(M\xff\xfft', stride=b'(K\0t'), 'size': b'(M\xff\xfft'}, 'archive')])
def test_tensors_that_exceed_their_storage_are_rejected(path, change, named):
    write_pickle(path, b'\x80\x02' + tensor(**change) + b'.')
    with pytest.raises(WeightsError, match=named):
        read_checkpoint(path)


def with_flipped_byte(content):
    """In the middle of the largest file of an archive: between the files are bytes without a checksum."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        largest = max(map(archive.read, archive.namelist()), key=len)
    middle = content.index(largest) + len(largest) // 2
    return content[:middle] + bytes([content[middle] ^ 255]) + content[middle + 1:]


@pytest.mark.parametrize('prepare, named', [
    (lambda path, content: write(path, with_flipped_byte(content)), 'truncated'),
    (lambda path, content: write(path, b'Not Found'), 'zip'),
    (lambda path, content: write_checkpoint(path, LAYOUT, root='SegmentationModel'), 'SegmentationModel'),
    (lambda path, content: write_pickle(path, pickle.dumps({}, 2), zipfile.ZIP_DEFLATED), 'data.pkl is compressed'),
    (lambda path, content: None, 'No such file')])
def test_errors_name_the_file_the_cause_and_the_expected_format(path, content, prepare, named):
    prepare(path, content)
    with pytest.raises(WeightsError) as error:
        read_checkpoint(path)
    assert path in str(error.value) and named in str(error.value) and EXPECTED in str(error.value)


@pytest.mark.parametrize('change,named', [
    (lambda rows: rows['backbone'].__setitem__(0, [-1, 1, 'os.system', ['x']]), 'os.system'),
    (lambda rows: rows['backbone'].__setitem__(0, [-1, 1, 'Conv', [10 ** 9, 3]]), '200 million'),
    (lambda rows: rows['backbone'].__setitem__(0, [-1, 1, 'Conv', [64, 10 ** 6]]), 'kernel.* Conv .*31'),
    (lambda rows: rows['head'].pop(), 'Detect'),
    (lambda rows: rows.update(activation='__import__("os")'), 'activation')])
def test_layouts_that_no_release_has_are_rejected(change, named):
    rows = layout('6.0', 'n')
    change(rows)
    with pytest.raises(ValueError, match=named):
        Network(rows)
