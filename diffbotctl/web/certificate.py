"""The certificate of the page's server: made at the first start, kept with its key."""

from __future__ import annotations

import os
import socket
import ssl
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from diffbotctl import user_folders
from diffbotctl.errors import Problem, RunError

VALIDITY = timedelta(days=800)  # iOS accepts at most 825 days of a certificate that a person trusts
RENEWAL = timedelta(days=30)  # before its end a new one is made
FILE = "certificate.pem"  # the key, then the certificate


class ServerCertificate(NamedTuple):
    """A TLS context with the certificate, and the certificate's SHA-256 as browsers show it."""

    context: ssl.SSLContext
    fingerprint: str


def state_folder() -> Path:
    return user_folders.state_folder() / "web"


def load_certificate(folder: Path, addresses: list[str], now: datetime) -> ServerCertificate:
    """The certificate in `folder`; a new one for `addresses` if there is none that is valid.

    Raises RunError when the folder cannot be written.
    """
    path = folder / FILE
    try:
        certificate = _read(path)
        if certificate is None or not _is_valid(certificate, now):
            certificate = _make(path, addresses, now)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        context.load_cert_chain(path)
    except OSError as error:
        cause = f"cannot keep the certificate of the page there: {error.strerror}"
        fix = "free disk space, or set XDG_STATE_HOME to another folder"
        raise RunError(Problem("E-WEB-CERTIFICATE", str(path), cause, fix)) from error
    digest = certificate.fingerprint(hashes.SHA256()).hex().upper()
    return ServerCertificate(context, ":".join(_pairs(digest)))


def _is_valid(certificate: x509.Certificate, now: datetime) -> bool:
    """Whether it is valid, and still will be for a while.

    One that is not valid yet was made while the clock was wrong: some computers have none that
    runs on without power.
    """
    begins, ends = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    return begins <= now <= ends - RENEWAL


def _pairs(text: str) -> list[str]:
    return [text[i : i + 2] for i in range(0, len(text), 2)]


def _read(path: Path) -> x509.Certificate | None:
    """The certificate in the file; None if there is no usable one, or others may read its key."""
    try:
        status = path.stat()
        if status.st_mode & 0o077 or status.st_uid != os.getuid():
            return None
        data = path.read_bytes()
        serialization.load_pem_private_key(data, None)
        return x509.load_pem_x509_certificate(data)
    except (FileNotFoundError, ValueError):
        return None


def _make(path: Path, addresses: list[str], now: datetime) -> x509.Certificate:
    key = ec.generate_private_key(ec.SECP256R1())
    host = socket.gethostname()
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"diffbotctl on {host}"[:64])])
    names: list[x509.GeneralName] = [
        x509.DNSName(each) for each in (host, f"{host}.local", "localhost")
    ]
    names += [x509.IPAddress(ip_address(address)) for address in addresses]
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))  # the clock of a phone may be behind
        .not_valid_after(now + VALIDITY)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .sign(key, hashes.SHA256())
    )
    key_text = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    path.parent.mkdir(parents=True, mode=0o700, exist_ok=True)
    path.unlink(missing_ok=True)
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
    with open(file, "wb") as stream:
        stream.write(key_text + certificate.public_bytes(serialization.Encoding.PEM))
    return certificate


def utc_now() -> datetime:
    """The present time, for `load_certificate`."""
    return datetime.now(UTC)
