//! `gusset serve --protocol openfresco…`: a specimen behind OpenFresco's dialects.

use anyhow::Context;

use super::args::ServeArgs;
use super::exit::{Exit, WithExit};
use super::log::remark;
use super::serve_start::{misasked, say_ready};
use super::serve_tls;
use super::tell;
use crate::config::Served;
use crate::link::openfresco::{
    Door, DoorError, Host, Nature, News, Role, ServeSettings, serve_openfresco,
};
use crate::link::socket::{resolve, resolve_host};
use crate::link::spec::Carrier;
use crate::rt;
use crate::session::{Signal, Signals, missing};
use crate::setup::rt_plan;
use crate::wire::openfresco::Carrier as Bytes;

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
        return Err(misasked(&served.locator, flag, &["key_file"], &text));
    }
    let wishes = &served.serve.openfresco;
    let nature = if wishes.physical {
        Nature::Physical
    } else {
        Nature::Simulated
    };
    for text in served.host.first_command(nature == Nature::Physical) {
        tell(format_args!("note: {text}"));
    }
    let remembers = nature == Nature::Physical || served.host.remembers();
    let station = served.host.station(remembers).map_err(anyhow::Error::msg)?;
    let host = Host::of(station, nature, wishes.step_s);
    let mut host = match &served.transformation {
        Some(transformation) => host.transformed(transformation.clone()),
        None => host,
    };
    let bytes = match carrier {
        Carrier::Tcp | Carrier::Tls => Bytes::Stream,
        Carrier::Udp => Bytes::Datagrams,
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
            misasked(&served.locator, flag, &["openfresco", "client"], &error)
        })?,
        None => Vec::new(),
    };
    let unheard = |error: DoorError| {
        let flag = args.listen.as_ref().map(|_| "--listen");
        misasked(&served.locator, flag, &["listen"], &error)
    };
    if let Some(text) = order_note(&settings, host.axes()) {
        tell(format_args!("note: {text}"));
    }
    let door = match serve_tls::tls(
        args,
        served,
        carrier,
        !clients.is_empty() || is_loopback(listen),
    )? {
        Some(tls) => Door::bind_tls(listen, clients, tls),
        None => Door::bind(bytes, listen, clients),
    }
    .map_err(unheard)?;
    let signals = Signals::listen().context("signals cannot be taken over")?;
    let requests = signals.requests();
    if let Some(timing) = &served.timing {
        let granted = rt::apply(&rt_plan(timing, USUAL_PERIOD_NS));
        host.keep_log_away_from(granted.cpu);
        let missing = missing(&granted);
        if granted.must_refuse() {
            let text = format!("real-time conditions are required: {}", missing.join("; "));
            return Err(WithExit(Exit::NoRealTime, text).into());
        }
        for text in missing {
            tell(format_args!("warning: not granted: {text}"));
        }
    }
    say_ready(door.local_addr()?)?;
    serve_openfresco(
        &door,
        &mut host,
        &settings,
        &|| !requests.is_empty(),
        &mut |news: &News| {
            if !args.quiet {
                remark(news);
            }
        },
    )?;
    Ok(match signals.seen() {
        Some(Signal::Terminate) => Exit::Terminated,
        Some(Signal::Interrupt) | None => Exit::Interrupted,
    })
}

/// What SimSimulink's user should know before the first client comes: where the order of its signals will be asked for.
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
