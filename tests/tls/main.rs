//! Links and servers over TLS: certificates, refusals, faults, OpenFresco, OpenSSL, and the same numbers.

#[path = "../link_common/mod.rs"]
mod link_common;
#[path = "../openfresco_ends/mod.rs"]
mod openfresco_ends;
#[path = "../common/test_file.rs"]
mod test_file;
#[path = "../tls_common/mod.rs"]
mod tls_common;

mod faults;
mod openfresco;
mod openssl;
mod refusals;
mod same_bits;
