//! `gusset serve`.

use std::path::Path;

use super::args::{ProtocolArg, ServeArgs, SignalOrderArg, TransportArg};
use super::conduct;
use super::control::latched;
use super::exit::Exit;
use super::serve_reports::Reports;
use super::serve_start::{misasked, run_until_signal, unbound};
use super::test_file::refused;
use super::{serve_openfresco, serve_tls, tell};
use anyhow::Context;
use gusset_config::{self as config, Carrier, ClientCertificate, Offer, SignalOrderSpec};
use gusset_link::openfresco::Role;
use gusset_link::secret::read_key;
use gusset_link::served::RecordSettings;
use gusset_link::server::{Host, ServeOptions, Server, USUAL_LISTEN};
use gusset_proof::Verdict;
use gusset_session::Judged;
use gusset_setup::{self as setup, Served, load_served, openfresco_role, rt_plan};

/// The budget of the data thread's busy loop is judged for this period; the true one is the controller's.
const USUAL_PERIOD_NS: u64 = 1_000_000;

/// Hosts one specimen until a signal ends it.
pub fn serve(args: &ServeArgs) -> anyhow::Result<Exit> {
    let mut served = load_served(&args.file, args.specimen.as_deref()).map_err(refused)?;
    for warning in &served.source.warnings {
        tell(format_args!("warning: {warning}"));
    }
    anyhow::ensure!(
        (0.0..=1e6).contains(&args.spin),
        "--spin is {} us, wanted 0 to 1000000",
        args.spin
    );
    let protocol = match args.protocol {
        Some(ProtocolArg::Gusset) => Offer::Gusset,
        Some(ProtocolArg::Openfresco) => Offer::OpenFresco,
        Some(ProtocolArg::OpenfrescoActor) => Offer::OpenFrescoActor,
        Some(ProtocolArg::OpenfrescoController) => Offer::OpenFrescoController,
        Some(ProtocolArg::OpenfrescoSimulink) => Offer::OpenFrescoSimulink,
        None => served.source.file.serve.protocol.unwrap_or_default(),
    };
    served.source.check_protocol(protocol).map_err(refused)?;
    if protocol == Offer::Gusset && args.client.is_some() {
        anyhow::bail!(
            "--client is for OpenFresco's protocols; our own knows a key (--key) and certificates (--transport tls)"
        );
    }
    take_signal_order(args, &mut served, protocol)?;
    let carrier = match args.transport {
        Some(TransportArg::Tcp) => Carrier::Tcp,
        Some(TransportArg::Udp) => Carrier::Udp,
        Some(TransportArg::Tls) => Carrier::Tls,
        None => served.source.file.serve.transport.unwrap_or_default(),
    };
    let pace = served.source.file.serve.pace.as_ref();
    if carrier == Carrier::Udp && pace.is_some_and(config::PaceTable::predicts) {
        anyhow::bail!(
            "`between = \"predict\"` in `serve.pace` needs TCP or TLS: nothing shows that a client of datagrams is lost"
        );
    }
    let listen = listen_address(args, &served, protocol, carrier)?;
    let verdict = served.verdict(protocol);
    if let Some(verdict) = &verdict {
        conduct::obey_verdict(verdict, &served.source.locator, "gateway")?;
    }
    let mut inputs = Vec::new();
    if let Some(path) = &args.fault {
        let text = config::read_text(path).map_err(refused)?;
        inputs.push((path.clone(), text.clone().into_bytes()));
        served.host = play(path, text, served.host, protocol)?;
    }
    let reports = Reports::begin().context("the system gives no thread")?;
    if let Some(root) = &args.out {
        served.source.file.serve.protocol = Some(protocol);
        served.source.file.serve.transport = Some(carrier);
        served.source.file.serve.listen = args.listen.clone().or(served.source.file.serve.listen);
        if let (true, Some(specimen)) = (
            served.source.file.title.trim().is_empty(),
            served.source.file.specimen.first(),
        ) {
            served.source.file.title.clone_from(&specimen.name);
        }
        let record = served.source.file.record.clone().unwrap_or_default();
        served.host = served.host.recorded(RecordSettings {
            root: root.clone(),
            file: served.source.text.clone().into_bytes(),
            resolved: toml::to_string(&served.source.file)
                .context("the configuration cannot be written")?,
            inputs,
            about: served.source.file.about.as_json(),
            queue_s: record.queue_s,
            required: record.required,
            accepted: verdict.as_ref().map(Verdict::accepted).unwrap_or_default(),
            verdict: verdict.as_ref().map(Verdict::record),
            ended: Some(reports.sender()),
        });
        // An unavailable folder is reported now, and not when a controller comes.
        std::fs::create_dir_all(root).with_context(|| root.display().to_string())?;
    }
    let openfresco = openfresco_role(protocol);
    let physical = served.host.is_gateway()
        || (openfresco.is_some() && served.source.file.serve.openfresco.physical);
    if served.source.is_test && served.host.is_gateway() {
        judge(&args.file)?;
    }
    let (host, _control) = latched(
        served.host,
        args,
        served.source.file.specimen.first(),
        (physical, served.source.among_others),
    )?;
    served.host = host;
    if let Some((role, _)) = openfresco {
        return serve_openfresco::serve(args, &served, role, &listen, carrier);
    }
    if served.source.file.serve.tls.client_certificate == Some(ClientCertificate::Optional) {
        let text = "client_certificate = \"optional\" is for OpenFresco's protocols only; ours requires one";
        let key = ["tls", "client_certificate"];
        return Err(misasked(&served.source.locator, None, &key, &text));
    }
    let tls = serve_tls::tls(args, &served, carrier, false)?;
    for text in served.host.first_command(false) {
        tell(format_args!("note: {text}"));
    }
    let options = ServeOptions {
        listen,
        carrier,
        key: match &args.key {
            Some(path) => Some(read_key(path)?),
            None => served.key,
        },
        plan: served
            .source
            .file
            .timing
            .map(|timing| rt_plan(&timing, USUAL_PERIOD_NS)),
        spin_ns: (args.spin * 1e3) as u64,
    };
    let server = match tls {
        Some(tls) => Server::bind_tls(served.host, options, tls),
        None => Server::bind(served.host, options),
    }
    .map_err(|error| unbound(args, &served.source.locator, &error))?;
    run_until_signal(server, args.quiet, served.held.as_deref())
}

/// Obeys the verdict of a test file whose specimen this gateway would move.
fn judge(file: &Path) -> anyhow::Result<()> {
    tell(format_args!(
        "note: {} is a test file: the gateway rehearses the test and obeys its verdict; a file for `gusset serve` needs no test",
        file.display()
    ));
    let mut loaded = config::load(file, &[]).map_err(refused)?;
    // It is a processor of the controller's computer.
    loaded.file.timing.cpu = None;
    let test = setup::build(&loaded).map_err(refused)?;
    conduct::obey(&Judged::of(test).map_err(refused)?)
}

/// Takes the order of SimSimulink's signals from the command line, or else from the file. Refuses an order for a client that has
/// only one.
fn take_signal_order(args: &ServeArgs, served: &mut Served, protocol: Offer) -> anyhow::Result<()> {
    let flag = args.signal_order.map(|_| "--signal-order");
    let key = &mut served.source.file.serve.openfresco.signal_order;
    if let Some(order) = args.signal_order {
        *key = Some(match order {
            SignalOrderArg::ByAxis => SignalOrderSpec::ByAxis,
            SignalOrderArg::ByQuantity => SignalOrderSpec::ByQuantity,
        });
    }
    let role = openfresco_role(protocol).map(|(role, _)| role);
    let has_effect = role == Some(Role::Simulink);
    // The file may offer several protocols; only of OpenFresco's it must not promise another order than the one that holds.
    if has_effect || key.is_none() || (role.is_none() && flag.is_none()) {
        return Ok(());
    }
    let text = "`signal_order` is for openfresco-simulink only: clients of all other protocols send all displacements first, \
                then all velocities; leave it out, or serve --protocol openfresco-simulink";
    let key = ["openfresco", "signal_order"];
    Err(misasked(&served.source.locator, flag, &key, &text))
}

/// The host with the faults of the script at `path`, whose text this is.
fn play(path: &Path, text: String, host: Host, protocol: Offer) -> anyhow::Result<Host> {
    let script = config::parse_script(path, text).map_err(refused)?;
    let file = path.display();
    if protocol != Offer::Gusset {
        anyhow::bail!("{file}: faults are played over our own protocol only (--protocol gusset)");
    }
    if let Some(number) = script.at_the_controller() {
        anyhow::bail!(
            "{file}: fault {} happens at the controller, where a server cannot play it",
            number + 1
        );
    }
    let title = script.title.clone();
    let host = host.faulty(script).map_err(|error| match error.fault {
        Some(number) => anyhow::anyhow!("{file}: fault {}: {error}", number + 1),
        None => anyhow::anyhow!("{file}: {error}"),
    })?;
    tell(format_args!("FAULTS are played in every test: {title}"));
    Ok(host)
}

/// The address of the server: that of the option, of the file, or the usual one of the protocol.
fn listen_address(
    args: &ServeArgs,
    served: &Served,
    protocol: Offer,
    carrier: Carrier,
) -> anyhow::Result<String> {
    let given = args
        .listen
        .as_ref()
        .or(served.source.file.serve.listen.as_ref());
    let listen = match (given, openfresco_role(protocol)) {
        (Some(given), _) => given.clone(),
        (None, Some((_, port))) => format!("127.0.0.1:{port}"),
        (None, None) => USUAL_LISTEN.to_owned(),
    };
    let flag = args.listen.as_ref().map(|_| "--listen");
    served
        .source
        .check_listen(&listen, carrier, flag)
        .map_err(refused)?;
    Ok(listen)
}
