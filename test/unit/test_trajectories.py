"""Recordings of pedestrians: reading, smoothing, and errors."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.tracking.trajectories import (FEWEST_POINTS, LONGEST_GAP_S, made_sequences,
                                                            pedestrian_of, read_sequence, read_sequences)

TIMES_S = np.arange(0, 8, 0.4)


def csv_file(folder, rows, header='t_s,id,x_m,y_m', name='plaza.csv'):
    path = folder / name
    path.write_text('\n'.join([header] + [','.join(map(str, row)) for row in rows]) + '\n')
    return str(path)


def walk(times_s=TIMES_S, person=1):
    return [(time_s, person, 1 + 1.2 * time_s, 2 - 0.5 * time_s) for time_s in times_s]


def test_velocity_is_the_derivative_and_noise_is_smoothed():
    random = np.random.RandomState(0)
    true_m = np.stack((3 * np.cos(0.4 * TIMES_S), 3 * np.sin(0.4 * TIMES_S)), axis=1)
    noisy_m = true_m + random.normal(0, 0.02, true_m.shape)
    person = pedestrian_of(TIMES_S, noisy_m)
    middle_s = np.linspace(1, 6, 50)
    slope = (person.position_m(middle_s + 1e-4) - person.position_m(middle_s - 1e-4)) / 2e-4
    assert np.allclose(person.velocity_mps(middle_s), slope, atol=1e-5)
    assert np.std(person.position_m(TIMES_S) - true_m) < 0.9 * np.std(noisy_m - true_m)


def test_a_recording_is_read_by_name_with_its_people(tmp_path):
    csv_file(tmp_path, walk() + walk(TIMES_S[:10], person=2))
    csv_file(tmp_path, walk(), name='alley.csv')
    alley, plaza = read_sequences(str(tmp_path))
    assert (alley.name, plaza.name) == ('alley', 'plaza')
    assert len(plaza.pedestrians) == 2 and plaza.span_s == (0, pytest.approx(7.6))
    assert np.allclose(plaza.pedestrians[0].velocity_mps([1.0, 2.0]), (1.2, -0.5))


@pytest.mark.parametrize('rows,header,people', [
    (walk(np.append(TIMES_S, TIMES_S[-1] + LONGEST_GAP_S - 0.1 + TIMES_S)), 't_s,id,x_m,y_m', 1),
    (walk(np.append(TIMES_S, TIMES_S[-1] + LONGEST_GAP_S + 0.1 + TIMES_S)), 't_s,id,x_m,y_m', 2),
    (walk() + [(0.0, 2, 5, 5)] + walk(TIMES_S[:FEWEST_POINTS - 1], person=3), 't_s,id,x_m,y_m', 1),  # too few points
    (walk() + [(0.2, 1, 'nan', 3), (0.4, 1, 99, 99)], 't_s,id,x_m,y_m', 1),  # missing and duplicate points
    (walk(), '\ufefft_s,id,x_m,y_m', 1)])  # byte order mark of spreadsheets
def test_segments_with_enough_points_are_people(tmp_path, rows, header, people):
    sequence = read_sequence(csv_file(tmp_path, rows, header))
    assert len(sequence.pedestrians) == people
    assert np.allclose(sequence.pedestrians[0].position_m(TIMES_S)[:, 0], 1 + 1.2 * TIMES_S)


@pytest.mark.parametrize('rows,header,message', [
    ([(0, 1, 2, 3)], 't_s,id,x_m,y_m', 'no person has 6 points'),
    ([], 't_s,id,x_m,y_m', 'no person has 6 points'),
    ([(0, 1, 2, 3)], 'frame,id,x,y', 'has the columns frame,id,x,y'),
    ([(0, 1, 2, 3), (0.4, 1, 'left', 3)], 't_s,id,x_m,y_m', 'line 3: 0.4,1,left,3 is not a point'),
    ([('nan', 1, 2, 3)], 't_s,id,x_m,y_m', 'line 2: nan,1,2,3 is not a point'),
    ([(0, 1, 2)], 't_s,id,x_m,y_m', 'line 2: 0,1,2,None is not a point')])
def test_invalid_files_are_named(tmp_path, rows, header, message):
    with pytest.raises(ValueError, match='plaza.csv.*' + message):
        read_sequence(csv_file(tmp_path, rows, header))


def test_made_recordings_are_those_of_their_seed():
    first, again, other = (made_sequences(seed, 30) for seed in (1, 1, 2))
    assert [sequence.name for sequence in first] == ['made_sparse', 'made_dense']
    assert np.array_equal(first[1].points_m, again[1].points_m)
    assert first[1].points_m.shape != other[1].points_m.shape or not np.allclose(first[1].points_m, other[1].points_m)
    speeds_mps = [np.linalg.norm(person.velocity_mps((person.start_s + person.end_s) / 2))
                  for person in first[1].pedestrians]
    assert 0.8 < np.median(speeds_mps) < 1.6 and max(speeds_mps) < 2.5
