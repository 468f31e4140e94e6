//! Certificates for tests, made when they are needed and never kept.
#![allow(
    dead_code,
    reason = "each test is a separate program and uses its own part"
)]

use std::path::Path;

use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose, date_time_ymd,
};

/// A certificate authority.
pub struct Authority {
    issuer: Issuer<'static, KeyPair>,
    pem: String,
}

/// From and to, in years.
pub type Years = (i32, i32);
pub const VALID: Years = (2020, 2100);
pub const EXPIRED: Years = (2001, 2003);
pub const FUTURE: Years = (2098, 2100);

/// The names by which a test's server can be reached.
pub const LOCAL: &[&str] = &["localhost", "127.0.0.1", "::1"];

impl Authority {
    pub fn new() -> Self {
        Self::named("a laboratory")
    }

    pub fn named(name: &str) -> Self {
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params.distinguished_name.push(DnType::CommonName, name);
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        let key = KeyPair::generate().unwrap();
        let pem = params.self_signed(&key).unwrap().pem();
        Self {
            issuer: Issuer::new(params, key),
            pem,
        }
    }

    /// Writes `NAME.crt` and `NAME.key`: for a server or a client, by its name.
    pub fn issue(&self, folder: &Path, name: &str, names: &[&str], years: Years) {
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let mut params = CertificateParams::new(names).unwrap();
        params.distinguished_name.push(DnType::CommonName, name);
        params.not_before = date_time_ymd(years.0, 1, 1);
        params.not_after = date_time_ymd(years.1, 1, 1);
        params.extended_key_usages = vec![if name.starts_with("server") {
            ExtendedKeyUsagePurpose::ServerAuth
        } else {
            ExtendedKeyUsagePurpose::ClientAuth
        }];
        let key = KeyPair::generate().unwrap();
        let certificate = params.signed_by(&key, &self.issuer).unwrap();
        write(folder, &format!("{name}.crt"), &certificate.pem());
        write(folder, &format!("{name}.key"), &key.serialize_pem());
    }

    /// Writes the authority's own certificate.
    pub fn publish(&self, folder: &Path, name: &str) {
        write(folder, name, &self.pem);
    }
}

fn write(folder: &Path, name: &str, text: &str) {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    // A private key that other users can read is refused.
    if name.ends_with(".key") {
        use std::os::unix::fs::PermissionsExt;
        let owner = std::fs::Permissions::from_mode(0o600);
        std::fs::set_permissions(&path, owner).unwrap();
    }
}

/// All six files with the names that are looked for.
pub fn make(folder: &Path) -> Authority {
    let authority = Authority::new();
    authority.issue(folder, "server", LOCAL, VALID);
    authority.issue(folder, "client", &["controller"], VALID);
    authority.publish(folder, "server_ca.crt");
    authority.publish(folder, "client_ca.crt");
    authority
}
