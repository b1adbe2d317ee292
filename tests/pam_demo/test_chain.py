"""What chains of processes share with others: nothing that lasts."""

import os

from pam_demo.chain import private_domain, set_environment


def test_every_chain_has_a_domain_of_its_own():
    # a node that one chain lost would answer in the next one
    domains = [private_domain()["ROS_DOMAIN_ID"] for _ in range(100)]
    assert len(set(domains)) == 100
    assert all(1 <= int(domain) <= 100 for domain in domains)


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
