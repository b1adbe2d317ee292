"""What chains of processes share with others: nothing that lasts."""

import itertools
import os
import socket
import subprocess
import sys

import pytest

from pam_demo import chain
from pam_demo.chain import private_domain, set_environment


def test_every_chain_has_a_domain_of_its_own():
    # a node that one chain lost would answer in the next one; others may use some meanwhile
    domains = [private_domain()["ROS_DOMAIN_ID"] for _ in range(40)]
    assert len(set(domains)) == 40
    assert all(1 <= int(domain) <= 100 for domain in domains)


@pytest.fixture
def domain() -> int:
    """One that is free."""
    return int(private_domain()["ROS_DOMAIN_ID"])


def asked_for_from(domain: int) -> int:
    """The domain that another process gets which would take this one."""
    program = (
        "import itertools; from pam_demo import chain; "
        f"print(chain.private_domain(itertools.count({domain - 1}))['ROS_DOMAIN_ID'])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return int(ended.stdout)


@pytest.mark.system  # other tests take domains at the same time
@pytest.mark.skipif(sys.platform != "linux", reason="names that end with their process are Linux's")
def test_another_process_gets_another_domain(domain):
    assert asked_for_from(domain) != domain
    chain._held.pop(domain).close()
    assert asked_for_from(domain) == domain


def test_a_domain_in_which_a_node_runs_is_passed_over(domain):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as node:
        node.bind(("", 7400 + 250 * domain + 10))
        assert int(private_domain(itertools.count(domain - 1))["ROS_DOMAIN_ID"]) != domain
    assert int(private_domain(itertools.count(domain - 1))["ROS_DOMAIN_ID"]) == domain


def test_environment_is_as_before_afterwards(monkeypatch):
    monkeypatch.setenv("PAM_TEST_SET", "before")
    monkeypatch.delenv("PAM_TEST_UNSET", raising=False)
    try:
        with set_environment({"PAM_TEST_SET": "within", "PAM_TEST_UNSET": "within"}):
            assert os.environ["PAM_TEST_SET"] == os.environ["PAM_TEST_UNSET"] == "within"
            raise KeyError
    except KeyError:
        pass
    assert os.environ["PAM_TEST_SET"] == "before"
    assert "PAM_TEST_UNSET" not in os.environ
