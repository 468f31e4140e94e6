//! The certificates of `gusset serve --transport tls`.

use std::path::Path;

use super::args::{ServeArgs, TlsArgs};
use super::serve_start::misasked;
use super::tell;
use gusset_config::{Carrier, ClientCertificate};
use gusset_link::tls::{TlsFiles, TlsServer};
use gusset_setup::Served;

/// The server's certificate and the clients that may command; `None` without TLS. `open`: the protocol allows clients
/// without a certificate by default, like OpenFresco's, and only this or one named machine can reach the port.
pub(super) fn tls(
    args: &ServeArgs,
    served: &Served,
    carrier: Carrier,
    open: bool,
) -> anyhow::Result<Option<TlsServer>> {
    let TlsArgs {
        tls_certificate,
        tls_key,
        tls_ca,
    } = &args.tls;
    let given = [
        ("--tls-certificate", tls_certificate),
        ("--tls-key", tls_key),
        ("--tls-ca", tls_ca),
    ];
    if carrier != Carrier::Tls {
        if let Some((name, _)) = given.iter().find(|(_, path)| path.is_some()) {
            anyhow::bail!("{name} is for --transport tls only");
        }
        return Ok(None);
    }
    let spec = &served.source.file.serve.tls;
    let mut files = TlsFiles::of_server(spec, args.file.parent().unwrap_or(Path::new("")));
    // Paths of the command line are relative to the working directory, as everywhere.
    for ((_, path), place) in
        given
            .iter()
            .zip([&mut files.certificate, &mut files.key, &mut files.ca])
    {
        if let Some(path) = path {
            path.clone_into(place);
        }
    }
    let required = match spec.client_certificate {
        Some(ClientCertificate::Required) => true,
        Some(ClientCertificate::Optional) => false,
        None => !open,
    };
    let tls = TlsServer::new(&files, required).map_err(|error| {
        let [certificate, key, ca] = &given;
        let (argument, path) = match error.key {
            "certificate_file" => certificate,
            "key_file" => key,
            _ => ca,
        };
        let flag = path.as_ref().map(|_| *argument);
        let text = format!("[serve.tls] `{}` ({argument}): {error}", error.key);
        misasked(&served.source.locator, flag, &["tls", error.key], &text)
    })?;
    if !required && !args.quiet {
        tell("TLS: a client without a certificate is let in, as OpenFresco's servers do");
    }
    Ok(Some(tls))
}
