function run = gusset_open(run_dir)
% GUSSET_OPEN  Opens a run folder in MATLAB and in Octave.
%
%   run = gusset_open('runs/first')
%   plot(run.time, run.x3), xlabel('time (s)'), ylabel(['displacement in ' run.units.x3])
%   plot(run.specimen(1).disp, run.specimen(1).force)
%
% The result is a struct:
%   run.NAME       one column vector per column of the record (time in s, x1 in m, v1 in m/s, force_1_1 in N, ...), one value
%                  per tick from t = 0 to the end of the test
%   run.units      a struct with the unit of each column
%   run.sequence   number of each row; a gap means lost rows
%   run.specimen   one element per specimen: name, and target, command, disp (m) and force (N), one column per axis
%   run.summary    the content of summary.json; empty while the test runs, and after a crash
%   run.events     a cell array with the lines of events.jsonl as structs
%   run.folder     the run folder
%
% It needs read_samples.m, which lies beside it. `gusset guide columns` explains every column. It reads up to the first damaged row.

if exist(fullfile(run_dir, 'samples.json'), 'file') ~= 2
    error('gusset_open:none', '%s is not a run folder: it has no samples.json', run_dir);
end
samples = read_samples(run_dir);
running = find(ismember(samples.state, [3 11 12 13]));    % a step, and ticks between two steps
if isempty(running)
    rows = zeros(0, 1);
else
    last = running(end);
    if last < numel(samples.state) && samples.state(last + 1) == 8 && samples.step(last + 1) ~= samples.step(last)
        last = last + 1;                                  % the row of a trip
    end
    rows = (running(1):last)';
end
names = fieldnames(samples.units);
for k = 1:numel(names)
    run.(names{k}) = samples.(names{k})(rows);
end
run.units = samples.units;
run.sequence = samples.sequence(rows);
run.folder = run_dir;
run.summary = struct([]);
path = fullfile(run_dir, 'summary.json');
if exist(path, 'file') == 2
    run.summary = jsondecode(fileread(path));
end
run.specimen = specimens(run, names);
run.events = events(fullfile(run_dir, 'events.jsonl'));
end

function found = specimens(run, names)
% One struct per specimen, from the columns force_1_1, force_1_2, force_2_1, ...
found = struct('name', {}, 'target', {}, 'command', {}, 'disp', {}, 'force', {});
number = 1;
while any(strcmp(names, sprintf('force_%d_1', number)))
    one = struct('name', sprintf('specimen %d', number), 'target', [], 'command', [], 'disp', [], 'force', []);
    axis_number = 1;
    while any(strcmp(names, sprintf('force_%d_%d', number, axis_number)))
        ending = sprintf('_%d_%d', number, axis_number);
        one.target = [one.target, run.(['target' ending])];
        one.command = [one.command, run.(['cmd' ending])];
        one.disp = [one.disp, run.(['meas' ending])];
        one.force = [one.force, run.(['force' ending])];
        axis_number = axis_number + 1;
    end
    if ~isempty(run.summary)
        declared = run.summary.limits.specimens;
        if iscell(declared)
            one.name = declared{number}.name;
        else
            one.name = declared(number).name;
        end
    end
    found(number) = one;
    number = number + 1;
end
end

function found = events(path)
% The events of events.jsonl. A line that a crash cut short is left out.
found = {};
if exist(path, 'file') ~= 2
    return
end
text = fileread(path);
last = find(text == sprintf('\n'), 1, 'last');
if ~isempty(last)
    lines = strsplit(text(1:last - 1), sprintf('\n'));
    found = cellfun(@jsondecode, lines, 'UniformOutput', false);
end
end
