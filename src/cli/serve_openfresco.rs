//! `gusset serve --protocol openfresco…`: a specimen behind OpenFresco's dialects.

use super::args::ServeArgs;
use super::exit::Exit;
use super::serve_start::{misasked, run_until_signal, unbound};
use super::serve_tls;
use super::tell;
use gusset_config::Carrier;
use gusset_link::openfresco::{Host, Nature, Role, ServeSettings};
use gusset_link::server::{ServeOptions, Server};
use gusset_link::socket::{resolve, resolve_host};
use gusset_setup::{Served, rt_plan};

/// The budget of a busy loop is judged for this period; a client has none.
const USUAL_PERIOD_NS: u64 = 1_000_000;

/// Hosts one specimen at the address `listen` until a signal ends it.
pub fn serve(
    args: &ServeArgs,
    served: &Served,
    role: Role,
    listen: &str,
    carrier: Carrier,
) -> anyhow::Result<Exit> {
    if args.key.is_some() || served.key.is_some() {
        let text =
            "OpenFresco's protocols know no key; name the machine that may command with --client";
        let flag = args.key.as_ref().map(|_| "--key");
        return Err(misasked(&served.source.locator, flag, &["key_file"], &text));
    }
    let wishes = &served.source.file.serve.openfresco;
    let nature = if wishes.physical {
        Nature::Physical
    } else {
        Nature::Simulated
    };
    for text in served.host.first_command(nature == Nature::Physical) {
        tell(format_args!("note: {text}"));
    }
    let remembers = nature == Nature::Physical || served.host.remembers();
    let specimen = served
        .host
        .specimen(remembers)
        .map_err(anyhow::Error::msg)?;
    let host = Host::of(specimen, nature, wishes.step_s)
        .iterating_within(wishes.iterates_within_m)
        .updating_tangent(wishes.updates_tangent);
    let host = match &served.transformation {
        Some(transformation) => host.transformed(transformation.clone()),
        None => host,
    };
    let mut settings = ServeSettings::new(
        role,
        match (wishes.idle_timeout_s, carrier) {
            (Some(limit), _) => Some(limit),
            (None, Carrier::Tcp | Carrier::Tls) => None,
            (None, Carrier::Udp) => Some(ServeSettings::UDP_IDLE_S),
        },
    );
    settings.signal_order = wishes.signal_order.map(Into::into);
    let clients = match args.client.as_ref().or(wishes.client.as_ref()) {
        Some(host) => resolve_host(host).map_err(|error| {
            let flag = args.client.as_ref().map(|_| "--client");
            misasked(
                &served.source.locator,
                flag,
                &["openfresco", "client"],
                &error,
            )
        })?,
        None => Vec::new(),
    };
    if let Some(text) = order_note(&settings, host.axes()) {
        tell(format_args!("note: {text}"));
    }
    let is_closed = !clients.is_empty() || is_loopback(listen);
    let tls = serve_tls::tls(args, served, carrier, is_closed)?;
    let timing = served.source.file.timing.as_ref();
    let options = ServeOptions {
        listen: listen.to_owned(),
        carrier,
        key: None,
        plan: timing.map(|timing| rt_plan(timing, USUAL_PERIOD_NS)),
        spin_ns: 0,
    };
    let server = Server::bind_openfresco(host, settings, options, clients, tls)
        .map_err(|error| unbound(args, &served.source.locator, &error))?;
    run_until_signal(server, args.quiet, served.held.as_deref())
}

/// Note for users of SimSimulink before the first client comes: how the order of its signals is determined.
fn order_note(settings: &ServeSettings, axes: usize) -> Option<String> {
    let is_open = settings.role == Role::Simulink && settings.signal_order.is_none() && axes > 1;
    is_open.then(|| {
        format!(
            "with {axes} axes a client that commands or measures more than one quantity, the time included, is refused: set \
             `signal_order` in [serve.openfresco], or --signal-order, to by_axis or by_quantity"
        )
    })
}

/// True if no other machine reaches the port.
fn is_loopback(listen: &str) -> bool {
    resolve(listen).is_ok_and(|all| all.iter().all(|address| address.ip().is_loopback()))
}
