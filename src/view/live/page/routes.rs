//! Paths of the server, and the headers of every answer.

use std::future::Future;
use std::sync::{Arc, Mutex, PoisonError};

use axum::Router;
use axum::body::Body;
use axum::extract::{ConnectInfo, Path, RawQuery, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use crossbeam_channel::Sender;
use serde_json::json;

use super::access::{AccessRules, Refusal};
use super::connections::{Connection, MOST_VIEWERS, Peer, WebListener};
use super::feed::{Feed, Viewer};
use crate::assets;
use crate::live::metrics::metrics;
use gusset_control::engine::{Glimpse, Operator, Phase};
use gusset_record::rt::os::monotonic_ns;
use gusset_record::{Event, Note, Word};

/// State that all handlers share.
#[derive(Debug)]
pub(super) struct Site {
    pub feed: Arc<Feed>,
    pub access: AccessRules,
    pub operator: Sender<Operator>,
    pub notes: Sender<Note>,
    pub refused: Refusals,
}

/// Counts refused requests. The first ones are recorded one by one, later ones together at intervals, so that a client
/// cannot fill the record.
#[derive(Debug, Default)]
pub(super) struct Refusals(Mutex<Refused>);

#[derive(Debug, Default)]
struct Refused {
    told: u64,
    told_ns: u64,
    untold: u64,
}

impl Refusals {
    /// Counts one; returns the number since the last record if another record is due.
    fn count(&self, now: u64) -> Option<u64> {
        let mut refused = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        refused.untold += 1;
        let due = refused.told < ONE_BY_ONE || now.saturating_sub(refused.told_ns) >= TELL_NS;
        due.then(|| {
            refused.told += 1;
            refused.told_ns = now;
            std::mem::take(&mut refused.untold)
        })
    }
}

type Shared = State<Arc<Site>>;

/// Refused requests that are recorded one by one.
const ONE_BY_ONE: u64 = 20;
/// Time between two records of later ones, ns.
const TELL_NS: u64 = 10_000_000_000;

/// The page loads scripts and styles from this server only and runs nothing inline. It is not shown in a frame.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; \
                      frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The report is one file with inline scripts and styles. It is shown in a frame of the page, and reaches neither the page nor
/// this server.
const REPORT_POLICY: &str = "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; \
                             style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'";

const HEADERS: [(&str, &str); 7] = [
    ("content-security-policy", POLICY),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cache-control", "no-store"),
];

const ICON: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 16 16\"><path d=\"M2 14V2l12 12z\" \
                    fill=\"#2a6fb0\"/></svg>";

/// Serves until `end`, and then until the last connection is done.
pub(super) async fn serve(
    listener: WebListener,
    site: Site,
    end: impl Future<Output = ()> + Send + 'static,
) {
    let site = Arc::new(site);
    let text = |kind: &'static str, body: &'static str| {
        get(move || async move { ([(header::CONTENT_TYPE, kind)], body) })
    };
    const SCRIPT: &str = "text/javascript; charset=utf-8";
    const STYLE: &str = "text/css; charset=utf-8";
    let licensed = format!(
        "/*!\n{}\n*/\n{}",
        assets::CHART_LICENCE,
        assets::CHART_SCRIPT
    );
    let chart: &'static str = Box::leak(licensed.into_boxed_str());
    let routes = Router::new()
        .route(
            "/",
            text("text/html; charset=utf-8", include_str!("page.html")),
        )
        .route("/page.css", text(STYLE, include_str!("page.css")))
        .route("/page.js", text(SCRIPT, include_str!("page.js")))
        .route("/store.js", text(SCRIPT, include_str!("store.js")))
        .route("/draw.js", text(SCRIPT, include_str!("draw.js")))
        .route("/charts.js", text(SCRIPT, include_str!("charts.js")))
        .route("/cards.js", text(SCRIPT, include_str!("cards.js")))
        .route("/chart.css", text(STYLE, assets::CHART_STYLE))
        .route("/chart.js", text(SCRIPT, chart))
        .route("/icon.svg", text("image/svg+xml", ICON))
        .route("/stream", get(stream))
        .route("/metrics", get(scrape))
        .route("/report/{key}", get(report))
        .route("/control/{what}", post(operate))
        .fallback(|| async { (StatusCode::NOT_FOUND, "there is nothing here\n") })
        .layer(from_fn_with_state(Arc::clone(&site), guard))
        .with_state(site);
    let service = routes.into_make_service_with_connect_info::<Peer>();
    let _never_fails = axum::serve(listener, service)
        .with_graceful_shutdown(end)
        .await;
}

/// The name by which we were called, before anything else; the heads, after everything else.
async fn guard(
    State(site): Shared,
    ConnectInfo(Peer(connection)): ConnectInfo<Peer>,
    request: Request,
    next: Next,
) -> Response {
    let _asking = connection.asks();
    let mut response = match site.access.host(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => refusal.into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in HEADERS {
        headers
            .entry(name)
            .or_insert(HeaderValue::from_static(value));
    }
    response
}

async fn report(State(site): Shared, Path(key): Path<String>) -> Response {
    let Some(text) = site.feed.report(&key) else {
        return (StatusCode::NOT_FOUND, "there is no report here\n").into_response();
    };
    let headers = [
        ("content-type", "text/html; charset=utf-8"),
        ("content-security-policy", REPORT_POLICY),
        ("x-frame-options", "SAMEORIGIN"),
    ];
    (headers, text).into_response()
}

async fn stream(
    State(site): Shared,
    ConnectInfo(Peer(connection)): ConnectInfo<Peer>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    site.access.view(&headers)?;
    if site.feed.viewers() >= MOST_VIEWERS {
        return Err(TOO_MANY_VIEWERS);
    }
    let viewer = Viewer::new(Arc::clone(&site.feed), connection.asks());
    let kind = [(header::CONTENT_TYPE, "text/event-stream")];
    Ok((kind, Body::from_stream(viewer)).into_response())
}

async fn scrape(State(site): Shared, headers: HeaderMap) -> Result<Response, Refusal> {
    site.access.view(&headers)?;
    let text = metrics(&site.feed.board, monotonic_ns(), site.feed.viewers());
    let kind = [(
        header::CONTENT_TYPE,
        "text/plain; version=0.0.4; charset=utf-8",
    )];
    Ok((kind, text).into_response())
}

const TOO_MANY_VIEWERS: Refusal = Refusal(
    StatusCode::SERVICE_UNAVAILABLE,
    "there are too many viewers; HOLD, CONTINUE, CONFIRM and STOP still work",
);

async fn operate(
    State(site): Shared,
    ConnectInfo(Peer(connection)): ConnectInfo<Peer>,
    Path(what): Path<String>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let seen = site.feed.board.glimpse();
    let from = connection.peer.to_string();
    let told = |accepted, why: Option<&'static str>| {
        Note::new(Event::ControlRequest {
            request: what.clone(),
            from: from.clone(),
            accepted,
            why: why.map(Word::from),
        })
    };
    // Without the token, no answer reveals which requests exist.
    let is_one = REQUESTS.contains(&what.as_str());
    if let Err(refusal) = site.access.control(&headers) {
        if is_one && let Some(times) = site.refused.count(monotonic_ns()) {
            let refused = Event::ControlRefused {
                request: what.clone(),
                from: from.clone(),
                why: refusal.1.into(),
                times,
            };
            // A full queue is enough of a warning.
            let _full = site.notes.try_send(refused.into());
        }
        return Err(refusal);
    }
    let request = match what.as_str() {
        CHECK => None,
        what => Some(request(what, query.as_deref())?),
    };
    if site.feed.board.ended().is_some() {
        return Err(Refusal(StatusCode::CONFLICT, OVER));
    }
    let Some(request) = request else {
        return Ok(StatusCode::ACCEPTED.into_response());
    };
    if let Some(why) = unheard(request, seen).or_else(|| unsent(request, &connection)) {
        let _full = site.notes.try_send(told(false, Some(why)));
        return Err(Refusal(StatusCode::CONFLICT, why));
    }
    let accepted = request.say_into(&site.operator).is_ok();
    let _full = site.notes.try_send(told(accepted, None));
    let status = if accepted {
        StatusCode::ACCEPTED
    } else {
        StatusCode::SERVICE_UNAVAILABLE
    };
    let kind = [(header::CONTENT_TYPE, "application/json")];
    let phase = seen.phase.word();
    let answer = json!({ "accepted": accepted, "phase": phase }).to_string();
    Ok((status, kind, answer).into_response())
}

/// The requests below `/control/`.
const REQUESTS: [&str; 5] = ["hold", "continue", "confirm", "stop", CHECK];

/// The request that only compares the token: the page sends it before it asks whether to stop.
const CHECK: &str = "check";

/// The operator command of a request; CONTINUE names the hold that it ends.
fn request(what: &str, query: Option<&str>) -> Result<Operator, Refusal> {
    match what {
        "hold" => Ok(Operator::Hold),
        "confirm" => Ok(Operator::Confirm),
        "stop" => Ok(Operator::Stop),
        "continue" => {
            let hold = query.and_then(|query| query.strip_prefix("hold="));
            let hold = hold.and_then(|number| number.parse().ok());
            hold.map(Operator::EndHold).ok_or(NO_HOLD_NAMED)
        }
        _ => Err(Refusal(
            StatusCode::NOT_FOUND,
            "wanted hold, continue, confirm or stop",
        )),
    }
}

const NO_HOLD_NAMED: Refusal = Refusal(
    StatusCode::BAD_REQUEST,
    "CONTINUE names the hold that it ends: POST /control/continue?hold=NUMBER, with the NUMBER of gusset_hold_number in /metrics",
);

/// The reason to drop a command that lets specimens move: its sender cannot see the effect any more.
fn unsent(request: Operator, connection: &Connection) -> Option<&'static str> {
    let lets_move = matches!(request, Operator::EndHold(_) | Operator::Confirm);
    (lets_move && connection.has_left()).then_some("its sender has left")
}

const OVER: &str = "the test is over";

/// Why the loop would ignore this request in its present state, if it would.
fn unheard(request: Operator, seen: Glimpse) -> Option<&'static str> {
    match seen.phase {
        _ if request == Operator::Stop => None,
        _ if request == Operator::Confirm => {
            (!seen.unconfirmed).then_some("nothing is to be confirmed")
        }
        phase if phase.can_be_held() => match request {
            Operator::EndHold(hold) if hold != seen.hold_number => {
                Some("another hold stands by now: look at the test, and say CONTINUE again")
            }
            _ => None,
        },
        Phase::Leaving => Some(
            "the test is shutting down: HOLD and CONTINUE have no effect; STOP freezes the specimens where they are",
        ),
        Phase::Tripped => Some("the test has tripped"),
        _ => Some(OVER),
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let Refusal(status, text) = self;
        let mut response = (status, format!("{text}\n")).into_response();
        if status == StatusCode::UNAUTHORIZED {
            let headers = response.headers_mut();
            headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn request_the_loop_ignores_is_refused() {
        for phase in Phase::ALL {
            for unconfirmed in [false, true] {
                let seen = Glimpse {
                    unconfirmed,
                    hold_number: 2,
                    ..Glimpse::of(phase)
                };
                let heard = |request| unheard(request, seen).is_none();
                assert!(heard(Operator::Stop));
                for request in [Operator::Hold, Operator::EndHold(2)] {
                    assert_eq!(heard(request), phase.can_be_held(), "{phase:?}");
                }
                assert!(!heard(Operator::EndHold(1)) && !heard(Operator::EndHold(3)));
                assert_eq!(heard(Operator::Confirm), unconfirmed, "{phase:?}");
            }
        }
    }

    #[test]
    fn a_continue_names_its_hold() {
        assert_eq!(
            request("continue", Some("hold=3")),
            Ok(Operator::EndHold(3))
        );
        for query in [None, Some(""), Some("hold="), Some("hold=-1"), Some("x=1")] {
            let refused = request("continue", query).unwrap_err();
            assert_eq!(refused.0, StatusCode::BAD_REQUEST);
        }
        assert_eq!(request("stop", None), Ok(Operator::Stop));
        assert_eq!(
            request("explode", None).unwrap_err().0,
            StatusCode::NOT_FOUND
        );
    }

    #[test]
    fn refusals_are_reported_then_summed() {
        let refused = Refusals::default();
        for _ in 0..ONE_BY_ONE {
            assert_eq!(refused.count(5), Some(1));
        }
        let soon = (0..1000).filter_map(|k| refused.count(6 + k)).count();
        assert_eq!(soon, 0);
        assert_eq!(refused.count(5 + TELL_NS), Some(1001));
    }
}
