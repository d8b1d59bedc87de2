"""``hil bench``: figures with machine and versions, as a table or as JSON."""

import typer

from hil.cli.bench import cost, links, pacing, peers, virtual_time

app = typer.Typer(help="Measure: what a cycle costs, how well it is paced.", no_args_is_help=True)

app.command("cycle")(cost.cycle)
app.command("rate")(pacing.rate)
app.command("arms")(pacing.arms)
app.command("start")(pacing.start)
app.command("view")(pacing.view)
app.command("answer")(links.answer)
app.command("servo")(links.servo)
app.command("chain")(links.chain)
app.command("kst")(links.kst)
app.command("reaction")(virtual_time.reaction)
app.command("replay")(virtual_time.replay)
app.command("memory")(virtual_time.memory)
app.command("campaign")(virtual_time.campaign)
app.command("kinematics")(cost.kinematics)
app.command("can402")(cost.can402)
app.command("peers")(peers.peers)
