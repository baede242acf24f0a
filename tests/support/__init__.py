"""Fakes and measurements that the tests and the proof share; nothing of a run imports them."""
