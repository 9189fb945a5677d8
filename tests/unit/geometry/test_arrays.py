import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.geometry import arrays

COUNTS = st.lists(st.integers(0, 6), max_size=9)


@settings(deadline=None)
@given(COUNTS)
def test_owner_and_rank_name_every_member(counts):
    offsets = arrays.offsets_of(counts)
    assert offsets.dtype == np.int64
    assert np.array_equal(
        offsets[arrays.owners_of(offsets)] + arrays.ranks_of(counts), np.arange(sum(counts))
    )


@settings(deadline=None)
@given(COUNTS)
def test_going_round_a_part_takes_as_many_steps_as_it_has_members(counts):
    offsets = arrays.offsets_of(counts)
    following = arrays.successors(offsets)
    assert np.array_equal(arrays.predecessors(offsets)[following], np.arange(sum(counts)))
    for begin, count in zip(offsets[:-1], counts, strict=True):
        at, met = begin, set()
        for _ in range(count):
            met.add(int(at))
            at = following[at]
        assert at == begin
        assert met == set(range(begin, begin + count))
