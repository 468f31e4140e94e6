//! Connect, greet, agree: everything before the first command. Blocking, with time limits.

use super::ask::{ask, explained, not_welcome};
use super::live::Live;
use super::refused::SetupError;
use super::setup::NativeSetup;
use crate::inbox::Inbox;
use crate::tls::{TlsClient, is_alert};
use crate::{ConnectError, TcpTransport, Transport, UdpTransport};
use gusset_config::Carrier;
use gusset_quantity::substructure::{Introduction, LinkFault};
use gusset_wire::handshake::{self, Capabilities, Control};
use gusset_wire::native::{Decoder, Encoder, Frame, LARGEST_FRAME};
use gusset_wire::{Side, WireError};

/// Connects and agrees. Blocks, up to twice the time limit.
pub(super) fn connect(
    setup: &NativeSetup,
    tls: Option<&TlsClient>,
    wire: Option<Box<dyn Transport>>,
) -> Result<(Live, Introduction), SetupError> {
    let (mut transport, peer): (Box<dyn Transport>, String) = match (wire, setup.carrier) {
        (Some(wire), _) => (wire, setup.address.clone()),
        (None, Carrier::Tcp) => {
            let tcp = TcpTransport::connect(&setup.address, setup.connect_limit, setup.options)?;
            let peer = tcp.peer().to_string();
            (Box::new(tcp), peer)
        }
        (None, Carrier::Tls) => {
            let tls = tls.ok_or(SetupError::Bare)?;
            let (limit, options) = (setup.connect_limit, setup.options);
            let tls = tls.connect(&setup.address, limit, options, 2 * LARGEST_FRAME)?;
            let peer = tls.peer().to_string();
            (Box::new(tls), peer)
        }
        (None, Carrier::Udp) => {
            let udp = UdpTransport::connect(&setup.address, setup.options)?;
            let peer = udp.peer().to_string();
            (Box::new(udp), peer)
        }
    };
    let mut inbox = Inbox::new(setup.carrier.is_stream());
    let hello = setup.hello()?;
    let mut hello_bytes = handshake::encode(&Control::Hello(hello.clone()))?;
    if let Some(key) = &setup.key {
        handshake::prove_hello(&mut hello_bytes, key)?;
    }
    let mut encoder = Encoder::greeting(Side::Controller);
    let mut decoder = Decoder::greeting(Side::Specimen);
    let mut out = vec![0; LARGEST_FRAME];
    let limit = setup.connect_limit;
    let answer = ask(
        transport.as_mut(),
        &mut inbox,
        ("hello", limit),
        |transport| {
            let length = encoder.control(&hello_bytes, &mut out)?;
            let frame = out.get(..length).unwrap_or_default();
            transport.send(frame).map_err(SetupError::Lost)
        },
        // A separate thread connects and waits. It is not joined.
        &mut || true,
        |frame| {
            let received = decoder.open(frame)?;
            let Frame::Control(message) = received.frame else {
                return Ok(None);
            };
            match handshake::decode(message)? {
                Control::Welcome(welcome) => Ok(Some((welcome, message.to_vec()))),
                other => Err(not_welcome(other, "a welcome")),
            }
        },
    );
    let (welcome, welcome_bytes) = answer.map_err(|error| match error {
        // The machine reports that no program listens on that UDP port.
        SetupError::Lost(LinkFault::Closed) if setup.carrier == Carrier::Udp => {
            ConnectError::Refused {
                address: setup.address.clone(),
            }
            .into()
        }
        SetupError::Wire(WireError::Magic { found, .. })
            if setup.carrier == Carrier::Tcp && is_alert(&found) =>
        {
            SetupError::SpeaksTls
        }
        other => explained(other, transport.as_ref()),
    })?;
    let key = match &setup.key {
        Some(key) => {
            let key = key.session(&hello.nonce, &welcome.nonce, welcome.session);
            if welcome.keyed {
                handshake::verify_welcome(&hello_bytes, &welcome_bytes, &key)?;
            }
            Some(key)
        }
        None => None,
    };
    handshake::check_welcome(&hello, &welcome)?;
    if let Some(wider) = handshake::wider(&welcome.axes, &hello.axes) {
        let axis = hello.axes.into_iter().nth(wider.axis);
        let axis = axis.map(|axis| axis.name).unwrap_or_default();
        return Err(SetupError::Wider { axis, wider });
    }
    let axes = setup.axes.len();
    let live = Live::new(
        transport,
        inbox,
        Encoder::new(Side::Controller, axes, welcome.session, key.clone())?,
        Decoder::new(Side::Specimen, axes, welcome.session, key)?,
        setup,
        &welcome,
    );
    let mut warnings = setup.limits_of_their_own(&welcome);
    warnings.extend(setup.alarmed_early(&welcome));
    let measures = Capabilities::MEASURES_DISP.0 | Capabilities::SIMULATED.0;
    let introduction = Introduction {
        peer: format!(
            "\"{}\" at {peer} ({}, {}, watchdog {} s)",
            welcome.name, setup.carrier, welcome.software, welcome.watchdog_s
        ),
        stiffness: welcome.stiffness,
        standing: welcome.standing,
        measured: false,
        force: Vec::new(),
        warnings,
        simulated: welcome.capabilities.has(Capabilities::SIMULATED),
        keeps_state: welcome.capabilities.has(Capabilities::KEEPS_STATE),
        repeats_the_command: welcome.capabilities.0 & measures == 0,
    };
    Ok((live, introduction))
}
