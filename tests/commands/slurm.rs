//! A real Slurm of one node computes campaigns.
//!
//! The daemons belong to the test: they have its folder and free ports of the loopback, and it ends them by their process numbers.
//! Debian has them in the packages `slurm-wlm` and `munge`.

#![allow(clippy::disallowed_methods, reason = "other processes are waited for")]

use crate::common::test_file::TestFile;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;

use crate::campaign::{campaign, complete, plan};
use crate::common::{FRAME, Said, gusset, say};

/// Nothing takes this long unless it hangs.
const LONG: Duration = Duration::from_secs(300);
/// The daemons, in the order of their start, and the commands.
const PROGRAMS: [&str; 8] = [
    "munged",
    "slurmctld",
    "slurmd",
    "sbatch",
    "squeue",
    "scancel",
    "sinfo",
    "setpriv",
];

/// Waits until `is_true`.
#[track_caller]
fn wait(what: &str, mut is_true: impl FnMut() -> bool) {
    let end = Instant::now() + LONG;
    while !is_true() {
        assert!(Instant::now() < end, "{what} does not happen");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// A port of the loopback that is free now. It is outside the range from which the system gives out ports by itself.
fn free_port() -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let start = (std::process::id() % 2000) as u16;
    (0..2000)
        .map(|_| 30_000 + (start + NEXT.fetch_add(1, Ordering::Relaxed)) % 2000)
        .find(|port| TcpListener::bind(("127.0.0.1", *port)).is_ok())
        .expect("no port from 30000 to 31999 is free")
}

/// Slurm on this machine.
struct Slurm {
    folder: TempDir,
    path: OsString,
    daemons: Vec<Child>,
}

impl Slurm {
    /// Starts a cluster of one node. Without Slurm a test says SKIPPED, and fails where CI=true.
    fn start() -> Option<Self> {
        let mut path = std::env::var_os("PATH").unwrap_or_default();
        // Other users than root have no daemons on their path.
        path.push(":/usr/sbin:/sbin");
        let is_there = |name: &&str| std::env::split_paths(&path).any(|at| at.join(name).exists());
        if let Some(missing) = PROGRAMS.iter().find(|name| !is_there(name)) {
            let text = format!(
                "SKIPPED: Slurm is not installed ({missing}); `tools/test` installs it with CI=true\n"
            );
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{text}");
            // The test harness hides what a test prints.
            let _ = std::io::stderr().write_all(text.as_bytes());
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        // munged wants a socket that every user can reach.
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        let mut slurm = Self {
            folder,
            path,
            daemons: Vec::new(),
        };
        slurm.configure();
        slurm.start_munged();
        slurm.start_daemon("slurmctld", &["-D", "-c"]);
        slurm.start_daemon("slurmd", &["-D"]);
        wait("an idle node", || {
            slurm.check_daemons();
            slurm.says("sinfo", &["-h", "-o", "%T"]) == "idle"
        });
        Some(slurm)
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes `slurm.conf` for this node. Arrays have at most ten elements.
    fn configure(&self) {
        for name in ["state", "spool"] {
            fs::create_dir(self.at(name)).unwrap();
        }
        let node = self.says("slurmd", &["-C"]);
        let value = |key: &str| {
            let mut words = node.split_whitespace();
            let found = words.find_map(|word| word.strip_prefix(key)).unwrap();
            found.to_owned()
        };
        let (name, cpus) = (value("NodeName="), value("CPUs="));
        let memory = value("RealMemory=");
        let user = self.says("id", &["-un"]);
        let (control, node) = (free_port(), free_port());
        let folder = self.folder.path().display();
        let mut text = format!(
            "ClusterName=gusset\nSlurmctldHost={name}(127.0.0.1)\nSlurmctldPort={control}\nSlurmdPort={node}\n\
             AuthType=auth/munge\nAuthInfo=socket={folder}/munge.socket\nSlurmUser={user}\nSlurmdUser={user}\n\
             StateSaveLocation={folder}/state\nSlurmdSpoolDir={folder}/spool\n\
             SlurmctldPidFile={folder}/slurmctld.pid\nSlurmdPidFile={folder}/slurmd.pid\n\
             SlurmctldLogFile={folder}/slurmctld.log\nSlurmdLogFile={folder}/slurmd.log\n\
             CommunicationParameters=NoInAddrAny,NoCtldInAddrAny\nMaxArraySize=11\n"
        );
        text.push_str(
            "ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nMpiDefault=none\nMailProg=/bin/true\n\
             SelectType=select/cons_tres\nSelectTypeParameters=CR_Core\nReturnToService=2\n\
             JobAcctGatherType=jobacct_gather/none\nAccountingStorageType=accounting_storage/none\n",
        );
        let _ = write!(
            text,
            "NodeName={name} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory} State=UNKNOWN\n\
             PartitionName=debug Nodes={name} Default=YES MaxTime=INFINITE State=UP\n"
        );
        fs::write(self.at("slurm.conf"), text).unwrap();
    }

    fn start_munged(&mut self) {
        let key = self.at("munge.key");
        // This key protects nothing outside of the test.
        fs::write(&key, [b'g'; 128]).unwrap();
        fs::set_permissions(&key, fs::Permissions::from_mode(0o400)).unwrap();
        let option = |name: &str, file: &str| format!("--{name}={}", self.at(file).display());
        let options = [
            "-F".to_owned(),
            option("key-file", "munge.key"),
            option("socket", "munge.socket"),
            option("pid-file", "munged.pid"),
            option("log-file", "munged.log"),
            option("seed-file", "munge.seed"),
        ];
        let options: Vec<&str> = options.iter().map(String::as_str).collect();
        self.start_daemon("munged", &options);
        wait("the socket of munged", || {
            self.check_daemons();
            self.at("munge.socket").exists()
        });
    }

    /// Starts a daemon in the foreground. The system ends it if the thread of this test ends.
    fn start_daemon(&mut self, name: &str, options: &[&str]) {
        let mut command = self.command("setpriv");
        command.args(["--pdeathsig", "TERM", name]).args(options);
        let output = fs::File::create(self.at(&format!("{name}.out"))).unwrap();
        command
            .stdin(Stdio::null())
            .stderr(output.try_clone().unwrap());
        self.daemons.push(command.stdout(output).spawn().unwrap());
    }

    /// Fails with the output of the daemons if one of them has ended.
    fn check_daemons(&mut self) {
        let has_ended = |daemon: &mut Child| daemon.try_wait().unwrap().is_some();
        if self.daemons.iter_mut().any(has_ended) {
            let output = |name: &&str| fs::read_to_string(self.at(&format!("{name}.out")));
            let texts: Vec<_> = PROGRAMS[..3].iter().map(output).collect();
            panic!("a daemon of Slurm has ended: {texts:#?}");
        }
    }

    /// A command that sees this Slurm.
    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        self.seen_by(&mut command);
        command
    }

    fn seen_by(&self, command: &mut Command) {
        let conf = self.at("slurm.conf");
        // slurmd -C reads no configuration yet.
        if conf.exists() {
            command.env("SLURM_CONF", conf);
        }
        command.env("PATH", &self.path);
    }

    /// Standard output of a program.
    fn says(&self, program: &str, options: &[&str]) -> String {
        let output = self.command(program).args(options).output().unwrap();
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    }

    /// Submits a campaign from the folder above it, and returns the number of the job.
    fn submit(&self, out: &Path, more: &[&str]) -> String {
        let mut command = gusset();
        self.seen_by(&mut command);
        command.current_dir(out.parent().unwrap());
        command
            .args(["campaign", "submit"])
            .arg(out.file_name().unwrap());
        let said: Said = command
            .args(["--engine", "slurm"])
            .args(more)
            .output()
            .unwrap()
            .into();
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        let (_, number) = said.stderr.split_once("Submitted batch job ").unwrap();
        number.trim().to_owned()
    }

    /// Waits until no element of any job runs or waits.
    fn wait_for_jobs(&self) {
        wait("the end of the jobs", || {
            self.says("squeue", &["-h"]).is_empty()
        });
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        // Only jobs of this cluster are in its queue. A panic must not wait forever.
        let user = self.says("id", &["-un"]);
        self.says("scancel", &["-u", &user]);
        let end = Instant::now() + Duration::from_secs(60);
        while Instant::now() < end && !self.says("squeue", &["-h"]).is_empty() {
            std::thread::sleep(Duration::from_millis(50));
        }
        while let Some(mut daemon) = self.daemons.pop() {
            let _ = kill_process(Pid::from_child(&daemon), Signal::TERM);
            let end = Instant::now() + Duration::from_secs(20);
            while Instant::now() < end && matches!(daemon.try_wait(), Ok(None)) {
                std::thread::sleep(Duration::from_millis(20));
            }
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

/// The table of an undisturbed run of the study.
fn local_table(study: &Path, out: &Path) -> Vec<u8> {
    let said = campaign(
        "run",
        study,
        &["--out", out.to_str().unwrap(), "--prove", "0"],
    );
    complete(&said, out)
}

#[test]
fn slurm_gives_the_local_table() {
    let Some(slurm) = Slurm::start() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let study = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/campaigns/ida-frame.toml");
    let out = folder.path().join("ida");
    plan(&study, &out, "12");
    slurm.submit(&out, &["--", "--job-name=frames"]);
    assert_eq!(
        slurm.says("squeue", &["-h", "-o", "%j"]).lines().next(),
        Some("frames")
    );
    let script = fs::read_to_string(out.join("slurm.sh")).unwrap();
    // The cluster permits ten elements: two of the twenty chunks each.
    assert!(script.contains("\n#SBATCH --array=1-10\n"), "{script}");
    slurm.wait_for_jobs();
    let logs = fs::read_dir(out.join("logs")).unwrap();
    assert_eq!(logs.count(), 10);
    let said = say(["campaign", "collect", out.to_str().unwrap(), "--prove", "5"]);
    let table = complete(&said, &out);
    assert_eq!(table.iter().filter(|byte| **byte == b'\n').count(), 241);
    assert!(table == local_table(&study, &folder.path().join("local")));
}

/// A study of 24 tests of several tenths of a second each.
fn slow_study(folder: &Path) -> PathBuf {
    let frame = FRAME.with("time.duration_s = 600");
    fs::write(folder.join("frame.toml"), frame).unwrap();
    let path = folder.join("study.toml");
    let text = "test = \"frame.toml\"\n[[vary]]\nkey = \"structure.damping.rayleigh_ratio.ratio\"\n\
                linear = { from = 0.01, to = 0.05, count = 24 }\n";
    fs::write(&path, text).unwrap();
    path
}

/// The process that computes the chunks `chunks` of `out`, once it has used half a second of a processor.
fn busy_worker(out: &Path, chunks: &str) -> i32 {
    let folder = fs::canonicalize(out).unwrap();
    let end = [
        "campaign",
        "work",
        folder.to_str().unwrap(),
        "--chunk",
        chunks,
        "",
    ]
    .join("\0");
    let mut found = 0;
    wait("a busy worker", || {
        let processes = fs::read_dir("/proc").unwrap();
        let numbers = processes.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
        let is_it = |number: &i32| {
            let words = fs::read(format!("/proc/{number}/cmdline")).unwrap_or_default();
            String::from_utf8_lossy(&words).ends_with(&end)
        };
        let number = numbers.into_iter().find(is_it);
        found = number.unwrap_or_default();
        number.is_some_and(|number| processor_time(number) >= 50)
    });
    found
}

/// Processor time of a process in hundredths of a second.
fn processor_time(process: i32) -> u64 {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    let (_, fields) = stat.rsplit_once(") ").unwrap_or_default();
    // utime is field 14 of all, and these begin with field 3.
    let utime = fields.split(' ').nth(11).and_then(|text| text.parse().ok());
    utime.unwrap_or_default()
}

#[test]
fn killed_slurm_elements_are_resubmitted() {
    let Some(slurm) = Slurm::start() else {
        return;
    };
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().join("it's 100% \"odd\"");
    fs::create_dir(&folder).unwrap();
    let study = slow_study(&folder);
    let out = folder.join("campaign");
    plan(&study, &out, "4");
    let job = slurm.submit(&out, &["--tasks-per-job", "8"]);
    let killed = Pid::from_raw(busy_worker(&out, "1-2")).unwrap();
    kill_process(killed, Signal::KILL).unwrap();
    busy_worker(&out, "3-4");
    slurm.says("scancel", &[&format!("{job}_2")]);
    slurm.wait_for_jobs();
    let status = campaign("status", &out, &["--json"]);
    let status: Value = serde_json::from_str(&status.stdout).unwrap();
    // The third element was not disturbed, and the cancelled one wrote the results that it had.
    assert!(
        (9..24).contains(&status["done"].as_u64().unwrap()),
        "{status}"
    );
    let open = status["chunks_with_missing_tasks"].as_array().unwrap();
    let open: Vec<String> = open.iter().map(Value::to_string).collect();
    assert!(
        open.contains(&"2".to_owned()) && open.contains(&"4".to_owned()),
        "{status}"
    );
    slurm.submit(&out, &["--tasks-per-job", "1"]);
    let script = fs::read_to_string(out.join("slurm.sh")).unwrap();
    let list = format!("\n{}\nEND\n", open.join("\n"));
    assert!(script.contains(&list), "{script}");
    slurm.wait_for_jobs();
    let said = campaign("collect", &out, &["--prove", "0"]);
    assert!(complete(&said, &out) == local_table(&study, &folder.join("local")));
}
