//! Arguments of `gusset import`. The importer in Python gets them as JSON, by the names of the fields.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use serde::Serialize;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset import opensees frame.py --units kN,m,s --out frame.toml\n  \
    gusset import matrices bridge.mat --units kN,m,s --dofs x,y,rz --out bridge\n\n\
    The importer is written in Python and part of the Python package. The environment variable GUSSET_PYTHON names the Python \
    that has it [default: python3].\n\n\
    More: gusset guide import"
)]
pub(in crate::cli) struct ImportArgs {
    #[command(subcommand)]
    pub source: ImportSource,
}

/// Where a model comes from.
#[derive(Debug, Subcommand, Serialize)]
#[serde(tag = "source", rename_all = "snake_case")]
pub(in crate::cli) enum ImportSource {
    /// Write a test file from an OpenSees model. This runs its script, up to the first transient analysis.
    Opensees(ImportOpenseesArgs),
    /// Write a test file from the mass, stiffness and damping matrices of another program.
    Matrices(ImportMatricesArgs),
}

#[derive(Debug, Args, Serialize)]
#[command(
    after_help = "Examples:\n  gusset import opensees frame.tcl --units kip,in,s --list\n  \
    gusset import opensees frame.py --units kN,m,s --out frame.toml --replace 1=column\n\n\
    The command needs the Python package openseespy. Exits with 2 if the model cannot be imported; nothing is written then."
)]
pub(in crate::cli) struct ImportOpenseesArgs {
    /// Script of the model, in Python or Tcl.
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// Units of force, length and time in the script, for example kN,m,s.
    #[arg(long, value_name = "FORCE,LENGTH,TIME")]
    pub units: String,
    /// Write this test file. It must not exist.
    #[arg(long, value_name = "FILE", default_value = "model.toml")]
    pub out: PathBuf,
    /// List all commands that cannot be imported, and write nothing.
    #[arg(long)]
    pub list: bool,
    /// Turn the element TAG into a specimen of this name. Can be given several times.
    #[arg(long, value_name = "TAG=SPECIMEN")]
    pub replace: Vec<String>,
    /// Accept damping with the current or committed stiffness. The test file has the initial stiffness instead.
    #[arg(long)]
    pub accept_damping: bool,
    /// Longest time that the script may take, in s.
    #[arg(long = "timeout", value_name = "SECONDS", default_value_t = 300, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    pub timeout_s: u64,
}

#[derive(Debug, Args, Serialize)]
#[command(
    after_help = "Examples:\n  gusset import matrices bridge.mat --units kN,m,s --dofs x,y,rz --out bridge\n  \
    gusset import matrices job_STIF1.mtx job_MASS1.mtx --units N,mm,s --direction z\n  \
    gusset import matrices a.txt b.txt --mass a.txt --stiffness b.txt --units N,m,s --dofs x\n\n\
    The content of a file tells its format: Matrix Market, MATLAB (.mat), Abaqus (MATRIX INPUT and COORDINATE), ANSYS \
    (Harwell-Boeing with its .mapping), SAP2000 (.TXE, .TXK, .TXM).\n\n\
    The command needs the Python packages NumPy and SciPy, and h5py for MATLAB 7.3. Exits with 2 if the matrices cannot be imported; \
    nothing is written then."
)]
pub(in crate::cli) struct ImportMatricesArgs {
    /// Files with the matrices and, where the program writes them apart, the names of the degrees of freedom.
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// Units of force, length and time, for example N,mm,s. The unit of mass follows from them.
    #[arg(long, value_name = "FORCE,LENGTH,TIME")]
    pub units: String,
    /// Variable or file with the mass matrix [default: the one whose name says mass or M].
    #[arg(long, value_name = "NAME")]
    pub mass: Option<String>,
    /// Variable or file with the stiffness matrix [default: the one whose name says stiffness or K].
    #[arg(long, value_name = "NAME")]
    pub stiffness: Option<String>,
    /// Variable or file with the viscous damping matrix [default: the one whose name says damping or C, if any].
    #[arg(long, value_name = "NAME")]
    pub damping: Option<String>,
    /// For matrices without names: directions of the degrees of freedom in order (x, y, z, rx, ry, rz). A list for one node is
    /// repeated for every node.
    #[arg(long, value_name = "LIST")]
    pub dofs: Option<String>,
    /// Direction of the ground motion: x, y or z.
    #[arg(long, value_name = "DIRECTION", default_value = "x")]
    pub direction: String,
    /// Write model.toml, the matrices and a table of the degrees of freedom into this folder. It must be new or empty.
    #[arg(long, value_name = "DIR", default_value = "model")]
    pub out: PathBuf,
}
