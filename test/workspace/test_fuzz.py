"""Wrong input, for a few seconds; `./run fuzz` takes minutes. And what it found, each by itself."""
import pytest

from fuzz.functions import FUNCTIONS, fuzz_functions
from fuzz.nodes import TARGETS, fuzz_node


def test_functions_refuse_wrong_values_by_a_value_error():
    counts = fuzz_functions(7, 10000)
    assert sum(calls for calls, _refused in counts.values()) == 10000 and set(counts) == set(FUNCTIONS)
    refused = sum(refused for _calls, refused in counts.values())
    assert 2000 < refused < 9000  # wrong ones are there, and good ones


@pytest.mark.parametrize('name', sorted(TARGETS))
def test_nodes_live_through_wrong_messages_and_the_next_good_one_works(name):
    sent, _cpu_s = fuzz_node(name, 7, 1000)
    assert sent >= 1000
