% N4SID by SLICOT's IB01AD and IB01BD, in GNU Octave's control package: octave-cli n4sid_slicot.m DATA ORDER HORIZON RUNS ANSWER
pkg load control
warning('off', 'all');
arguments = argv();
data = load(arguments{1});
order = str2double(arguments{2});
horizon = str2double(arguments{3});
runs = str2double(arguments{4});

function kilobytes = status(key)
  lines = fileread('/proc/self/status');
  kilobytes = str2double(regexp(lines, [key ':\s+(\d+)'], 'tokens'){1}{1});
end

short = iddata(data.y(1:2000, :), data.u(1:2000, :), 0.01);
found = n4sid(short, order, 's', horizon);
dat = iddata(data.y, data.u, 0.01);
file = fopen('/proc/self/clear_refs', 'w');
if file > 0
  fputs(file, '5');
  fclose(file);
end
before = status('VmRSS');
times = busy = zeros(1, runs);
for k = 1:runs
  used = cputime();
  start = tic();
  found = n4sid(dat, order, 's', horizon);
  times(k) = toc(start);
  busy(k) = cputime() - used;
end
memory = max(status('VmHWM') - before, 0) / 1024;
[a, b, c, d] = ssdata(found);
save('-mat7-binary', arguments{5}, 'times', 'busy', 'memory', 'a', 'b', 'c', 'd');
