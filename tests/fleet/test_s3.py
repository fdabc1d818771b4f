"""A fleet in a bucket of a real S3 server on this machine, read by HTTP as it would be from a cloud."""

from __future__ import annotations

import pytest

import idloop
from idloop.errors import InputError

moto = pytest.importorskip("moto.server")
s3fs = pytest.importorskip("s3fs")


@pytest.fixture(scope="module")
def bucket(recordings, plan, tmp_path_factory):
    """The recordings of the fleet and their table at ``s3://robots``."""
    server = moto.ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AWS_ENDPOINT_URL", "http://{}:{}".format(*server.get_host_and_port()))
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            patch.setenv(name, "test")
        fs = s3fs.S3FileSystem(use_listings_cache=False)
        fs.mkdir("robots")
        fs.put(str(recordings), "robots/bags", recursive=True)
        rows = [f"{bag.parent.name},j0,{bag.name},bags/{bag.parent.name}/{bag.name}" for bag in recordings.glob("*/*")]
        fs.pipe("robots/table.csv", "\n".join(["robot,joint,time,bag", *rows]).encode())
        yield fs
    server.stop()


@pytest.mark.slow
@pytest.mark.parametrize(("workers", "source", "joints"), [(0, "bags", 2), (1, "bags", 2), (0, "table.csv", 1)])
def test_a_bucket_gives_the_numbers_of_the_folder(
    bucket, recordings, settings, plan, tmp_path, workers, source, joints
):
    models = dict(settings.kinds)
    options = {"workers": workers, "diagnose": 0}
    found = idloop.identify_fleet(f"s3://robots/{source}", models, tmp_path / "s3", **options)
    assert (found.failed, found.joint_days) == ((), plan.robots * plan.days * joints)
    here = idloop.identify_fleet(recordings, models, tmp_path / "here", **options)
    there, same = (
        {(one.series.kind, one.series.parameter): one.level.tolist() for one in several.components}
        for several in (found, here)
    )
    assert there == {name: same[name] for name in there}
    assert idloop.identify_fleet(f"s3://robots/{source}", models, tmp_path / "s3", **options).new == 0


@pytest.mark.slow
def test_a_bag_that_changes_in_its_bucket_is_read_again(bucket, settings, plan, tmp_path):
    def run():
        found = idloop.identify_fleet("s3://robots/bags", dict(settings.kinds), tmp_path, workers=0, diagnose=0)
        return found.new, [one["bag"] for one in found.failed]

    (name, *_) = bucket.glob("robots/bags/robot001/*/*.mcap")
    whole = bucket.cat_file(name)
    assert run() == (plan.robots * plan.days, [])
    bucket.pipe(name, whole[:20000])
    assert run() == (1, [f"s3://{name.rpartition('/')[0]}"])
    bucket.pipe(name, whole)
    assert run() == (0, [])


def test_a_bucket_that_is_not_there_is_one_line(bucket):
    for place in ("nowhere", "nowhere/table.parquet", "robots/none"):
        with pytest.raises(InputError, match=f"s3://{place}: "):
            idloop.identify_fleet(f"s3://{place}", {}, "unused", workers=0)
