//! `gusset serve --protocol openfresco…`: a specimen of a file behind OpenFresco's dialects.

use anyhow::{Context, bail};

use super::exit::Exit;
use super::{CarrierArg, ProtocolArg, ServeArgs};
use crate::config::SpecimenTable;
use crate::link::openfresco::{
    Door, Host, Nature, News, Role, ServeSettings, serve_openfresco as serve_clients,
};
use crate::session::{Signal, Signals};
use crate::wire::openfresco::{APPLICATION_PORT, CONTROLLER_PORT, Carrier, SITE_PORT};

/// Serves until a signal comes.
pub fn serve_openfresco(args: &ServeArgs) -> anyhow::Result<Exit> {
    let (role, port) = match args.protocol {
        ProtocolArg::Openfresco => (Role::Application, APPLICATION_PORT),
        ProtocolArg::OpenfrescoActor => (Role::Actor, SITE_PORT),
        ProtocolArg::OpenfrescoController => (Role::Controller, CONTROLLER_PORT),
        ProtocolArg::OpenfrescoSimulink => (Role::Simulink, CONTROLLER_PORT),
    };
    let (carrier, idle) = match args.transport {
        CarrierArg::Tcp => (Carrier::Stream, None),
        CarrierArg::Udp => (Carrier::Datagrams, Some(ServeSettings::UDP_IDLE_S)),
    };
    let table = specimen(args)?;
    let axes = table.rows.as_ref().map_or_else(
        || match &table.laws {
            Some(crate::specimen::SpecimenLaw::Laws(laws)) => laws.len(),
            _ => 1,
        },
        Vec::len,
    );
    let Some((key, source)) = table.sources().into_iter().next() else {
        bail!("nothing stands for the specimen \"{}\"", table.name);
    };
    let law = source
        .build(axes)
        .with_context(|| format!("specimen \"{}\", {key}", table.name))?;
    let mut host = Host::new(law, Nature::Simulated, None);
    let listen = match &args.listen {
        Some(address) => address.clone(),
        None => format!("127.0.0.1:{port}"),
    };
    let door = Door::bind(carrier, &listen, args.client)?;
    let signals = Signals::listen().context("signals cannot be taken over")?;
    let requests = signals.requests();
    eprintln!("serving \"{}\" on {}", table.name, door.local_addr()?);
    let settings = ServeSettings::new(role, idle);
    let stop = || !requests.is_empty();
    serve_clients(&door, &mut host, &settings, &stop, &mut |news: &News| {
        eprintln!("{news}");
    })?;
    Ok(match signals.seen() {
        Some(Signal::Terminate) => Exit::Terminated,
        _ => Exit::Interrupted,
    })
}

fn specimen(args: &ServeArgs) -> anyhow::Result<SpecimenTable> {
    #[derive(serde::Deserialize)]
    struct File {
        specimen: Vec<SpecimenTable>,
    }
    let text = std::fs::read_to_string(&args.file)
        .with_context(|| format!("cannot read {}", args.file.display()))?;
    let file: File = toml::from_str(&text)?;
    let wanted = |table: &SpecimenTable| args.specimen.as_ref().is_none_or(|n| *n == table.name);
    let mut found = file.specimen.into_iter().filter(wanted);
    match (found.next(), found.next()) {
        (Some(table), None) => Ok(table),
        (None, _) => bail!("no such specimen"),
        (Some(_), Some(_)) => bail!("more than one specimen: name one with --specimen"),
    }
}
